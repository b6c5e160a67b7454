"""Calibration of a camera with a ChArUco board."""
