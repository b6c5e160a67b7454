"""What the robot drives on, and what that does to its balls."""
