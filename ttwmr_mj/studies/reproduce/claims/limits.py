"""The limits of all rules, fixed before any run. Errors are rms values over a run's second half."""

TRACTOR_FOLLOWS_M = 0.010  # P: a fifteenth of the robot's length
TRAILER_FOLLOWS_M = 0.020  # the trailer's COM, which also takes the tractor's error
SWINGS_RAD = 0.2  # peak to peak of the hitch angle
STILL_RAD = 0.02
GONE = 0.01  # of V at the start
EFFORT_RATIO = 1.2  # of what the reference itself needs
NEVER_RISES = 0.01  # of V at the start
NEAR_CONSTANT = 0.5  # |ρ·D − 1|
MOSTLY = 0.9  # of the samples
E5_SMALL_RAD = 0.05
AGREES_M = 0.010
DECADE_SHRINKS = 0.5  # each decade's time over that of the one before, in finite time
SOLUTION_S = 20.0  # a solution in continuous time that lasts so long exists

LIMITS: dict[str, float] = {name: value for name, value in globals().items() if name.isupper()}
