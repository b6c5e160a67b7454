"""The camera's chain: frames, sensor model, calibration, detection, pose, tracking."""
