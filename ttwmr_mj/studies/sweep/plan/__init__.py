"""What a sweep computes: its file, its parameters, its rows, and whether they can be run."""
