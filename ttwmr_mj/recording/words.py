"""Text that the viewer can draw: it ends itself over a character that its one font lacks."""

import re

# Latin, Greek and Cyrillic; dashes, quotes and dots; sub- and superscripts; arrows; signs of
# mathematics that its font (Inter) has
_DRAWABLE = (
    "\n -~\u00a0-\u0148\u014a-\u017f\u0391-\u03a1\u03a3-\u03c9\u0400-\u045f"
    "–—‘’“”•…⁰⁴-⁹₀-₉←-↓−√∞≈≠≤≥"
)
_UNDRAWABLE = re.compile(f"[^{_DRAWABLE}]")


def drawable(text: str) -> str:
    """The text with a question mark for every character that the viewer may lack."""
    return _UNDRAWABLE.sub("?", text)
