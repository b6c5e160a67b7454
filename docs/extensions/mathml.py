"""Formulas as MathML, which browsers draw by themselves: no script, no font, no network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from latex2mathml.converter import convert

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """A formula within a line."""
    translator.body.append(convert(node.astext()))


def display(translator: HTML5Translator, node: nodes.math_block) -> None:
    """A formula on a line of its own."""
    translator.body.append(f'<div class="formula">{convert(node.astext(), display="block")}</div>')


def close(_translator: HTML5Translator, _node: nodes.Element) -> None:
    """Nothing is left open."""


def drawn(translator: HTML5Translator, node: nodes.Element) -> None:
    """Draw, and skip what is inside."""
    from docutils import nodes

    (display if isinstance(node, nodes.math_block) else inline)(translator, node)
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer "mathml"."""
    app.add_html_math_renderer("mathml", (drawn, close), (drawn, close))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
