"""How large a run may get."""

MOST_PERIODS = 2_000_000  # control periods; they are kept in memory, about 0.6 kB each
ESCAPE = 1e4  # m or rad: no scenario may start or lead that far; a run that gets there has diverged
