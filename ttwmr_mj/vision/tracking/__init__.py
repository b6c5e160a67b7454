"""From pictures to the robot's state."""
