"""Controllers ranked on the same tasks, every row re-run by the command beside it."""
