"""The hybrid model over one control period."""
