"""The published laws on Eq. 31 itself."""
