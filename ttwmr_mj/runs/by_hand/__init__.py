"""A person drives."""
