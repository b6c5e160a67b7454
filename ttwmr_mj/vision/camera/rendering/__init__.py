"""Pictures of the robot, rendered in parts of the picture plane."""
