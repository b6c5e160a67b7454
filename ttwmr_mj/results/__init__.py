"""What a run leaves behind: trajectory, curves, metrics."""
