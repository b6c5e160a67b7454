"""A video of a run, from its files: no display and no simulation is needed."""
