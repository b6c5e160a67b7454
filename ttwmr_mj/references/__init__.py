"""Reference trajectories, each with derivatives to the fourth."""
