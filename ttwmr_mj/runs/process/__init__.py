"""The process that runs, its terminal and its machine."""
