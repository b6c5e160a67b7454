"""Controllers, one law per file."""
