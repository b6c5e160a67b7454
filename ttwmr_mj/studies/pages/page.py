"""Renders a report's template onto the page that all reports share."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from markupsafe import Markup


def render(package: str, template: str, **context: Any) -> str:
    """One HTML file that needs nothing beside it.

    Args:
        package: whose data file the template is.
        template: its name. It extends `base.html.j2` and imports `parts.html.j2`.
        context: what it shows; a name that is missing raises.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    folders = [str(resources.files(name)) for name in (package, __package__)]
    environment = Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["code"] = _code
    look = {name: _own(f"page.{name}") for name in ("css", "js")}
    return environment.get_template(template).render(look=look, **context)


def _own(name: str) -> Markup:
    from markupsafe import Markup

    return Markup((resources.files(__package__) / name).read_text(encoding="utf-8"))


def _code(text: str) -> Markup:
    """`name` in a text of ours is set in <code>."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", str(escape(text))))


POINTS_PER_REM = 12.0

# Colours of matplotlib and of figures/style.py → what they are on a dark page
# the first of the curves' colours is dark: it is lighter on dark paper
_ADAPTED = {"#ffffff": "var(--paper)", "#dddddd": "var(--grid)", "#0072b2": "var(--blue)"}
_ADAPTED |= dict.fromkeys(("#000000", "#222222"), "currentColor")


def inlined(drawing: Path) -> Markup:
    """An SVG file of ours as part of a page, light on dark where the page is.

    Ids get the file's name in front: several drawings on one page must not share any. Ink, paper
    and grid take the page's colours. White or black that must stay is written as #FEFEFE, #010101.
    """
    from markupsafe import Markup

    text, name = drawing.read_text(encoding="utf-8"), re.sub(r"\W", "_", drawing.stem)
    size = re.search(r'width="([\d.]+)pt".*?viewBox="([^"]+)"', text)
    assert size is not None  # of every SVG that `figures.canvas.save` writes
    text = text[text.index("</defs>") + len("</defs>") :] if "</defs>" in text else text
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'href="#', f'href="#{name}-', text)
    text = text.replace("url(#", f"url(#{name}-")
    for colour, adapted in _ADAPTED.items():
        text = re.sub(rf"(?<=: ){colour}\b", adapted, text, flags=re.IGNORECASE)
    width = f"--width: {float(size[1]) / POINTS_PER_REM:.1f}rem"
    return Markup(f'<svg class="drawing" viewBox="{size[2]}" style="{width}">{text}')
