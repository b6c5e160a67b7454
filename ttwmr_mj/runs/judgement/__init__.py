"""What a scenario asks for, whether it can be had, and whether a run did it."""
