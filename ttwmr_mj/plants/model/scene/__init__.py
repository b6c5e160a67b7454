"""Scenes of the user's own: the files they are made of, and what they may not change."""
