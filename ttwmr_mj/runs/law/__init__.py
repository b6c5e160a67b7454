"""The law in a run: one for all simulations or several, watched and checked."""
