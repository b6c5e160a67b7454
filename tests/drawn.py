"""What is really drawn into figures: their texts and curves."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def labels(figure: Path) -> list[str]:
    root = ET.parse(figure).getroot()
    return ["".join(e.itertext()) for e in root.iter() if e.tag.endswith("text")]


def drawn(
    monkeypatch: pytest.MonkeyPatch, module: str = "ttwmr_mj.figures.canvas"
) -> dict[str, dict[str, tuple[list, list]]]:
    """Figure → label of a curve → what is drawn (x, y), filled as figures are written.

    `module` is the one whose `save` is called.
    """

    drawer = import_module(module)

    curves: dict[str, dict[str, tuple[list, list]]] = {}
    save = drawer.save

    def spy(figure: Figure, path: Path, *dpi: float) -> Path:
        lines = [
            (axes.get_ylabel() or axes.get_title("left"), line)
            for axes in figure.axes
            for line in axes.lines
        ]
        names = [str(line.get_label()) for _, line in lines]
        curves[path.stem] = {
            # one without a name, or with one that others share, is told by its axis too
            name if names.count(name) == 1 and name[0] != "_" else f"{axis} {name}": (
                list(line.get_xdata()),
                list(line.get_ydata()),
            )
            for name, (axis, line) in zip(names, lines, strict=True)
        }
        return save(figure, path, *dpi)

    monkeypatch.setattr(drawer, "save", spy)
    return curves
