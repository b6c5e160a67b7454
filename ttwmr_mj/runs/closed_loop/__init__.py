"""The sampled closed loop, and what lies between controller and plant."""
