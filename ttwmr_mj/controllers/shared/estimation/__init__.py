"""What a law finds out on line: where the robot is, and what acts on it."""
