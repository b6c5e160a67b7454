"""References: what the robot shall follow, one kind per file, with its options and its motion."""
