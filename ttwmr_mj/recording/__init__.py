"""Recordings for the Rerun viewer; beside the studies' own, the only door to rerun."""
