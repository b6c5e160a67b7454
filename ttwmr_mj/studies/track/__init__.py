"""Tracking the robot through a video."""
