"""The hybrid model with what a real robot adds to it."""
