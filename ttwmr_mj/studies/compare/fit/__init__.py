"""Fitting the extended analytic model to contact physics."""
