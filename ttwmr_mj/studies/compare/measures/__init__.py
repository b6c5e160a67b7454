"""How far two runs are apart, and what the equations do not know."""
