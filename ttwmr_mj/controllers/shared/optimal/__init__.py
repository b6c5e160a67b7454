"""Tracking as a least-squares problem, and how it is solved."""
