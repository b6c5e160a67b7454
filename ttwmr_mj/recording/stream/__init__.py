"""How a recording reaches a file, and a viewer while it is written."""
