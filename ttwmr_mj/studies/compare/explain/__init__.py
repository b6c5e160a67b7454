"""Where a deviation comes from."""
