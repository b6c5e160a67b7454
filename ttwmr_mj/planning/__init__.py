"""Trajectory optimisation with CasADi and IPOPT: the makers of the planned references."""
