"""One run, from scenario to run folder."""
