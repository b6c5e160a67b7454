"""Plants: the analytic model and MuJoCo contact physics behind one protocol."""
