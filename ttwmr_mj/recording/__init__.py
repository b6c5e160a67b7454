"""Recordings for the Rerun viewer; beside the studies' own, the only door to rerun."""

import os

# Rerun prints what it thinks of a file without a table of contents: on purpose there is none
os.environ.setdefault("RUST_LOG", "error")
