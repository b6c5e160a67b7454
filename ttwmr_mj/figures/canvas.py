"""Where figures are drawn and saved: the same values give the same bytes, whole or not at all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from ttwmr_mj.figures.style import DPI, SIZE_IN, STYLE
from ttwmr_mj.files import importing_matplotlib, written
from ttwmr_mj.state import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Draw = Callable[["Figure"], None]


@contextmanager
def canvas(
    size_in: tuple[float, float] = SIZE_IN, looks: Mapping[str, Any] | None = None
) -> Iterator[Figure]:
    """An empty figure, whatever the user's matplotlibrc says; draw and save it in the context.

    Args:
        size_in: width and height [in].
        looks: matplotlib settings that replace those of STYLE.
    """
    with importing_matplotlib():
        import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE | dict(looks or {}))
        figure = Figure(figsize=size_in, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


METADATA: dict[str, dict[str, None]] = {  # what would make bytes depend on time and version
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def save(figure: Figure, path: Path, dpi: float = DPI) -> Path:
    """Write a .png, .svg or .pdf under another name first, so that nobody sees half a file."""
    with written(path) as draft:
        figure.savefig(draft, format=path.suffix[1:], dpi=dpi, metadata=METADATA[path.suffix])
    return path


def write_figures(
    drawings: Mapping[str, Draw], folder: Path, title: str, size_in: tuple[float, float] = SIZE_IN
) -> list[Path]:
    """Draw each as NAME.png and NAME.svg into a folder, made if it alone is missing; returns files.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    folder.mkdir(exist_ok=True)
    written: list[Path] = []
    for name, draw in drawings.items():
        with canvas(size_in) as figure:
            draw(figure)
            figure.suptitle(title)
            written += [save(figure, folder / f"{name}{ending}") for ending in (".png", ".svg")]
    return written


def time_axes(figure: Figure, label: str) -> Axes:
    """One pair of axes over time [s]."""
    axes = figure.subplots()
    axes.set(xlabel="time [s]", ylabel=label)
    axes.margins(x=0.01)
    return axes


def stacked(
    figure: Figure, time_s: FloatArray, panels: Sequence[tuple[str, FloatArray, str]]
) -> None:
    """Curves over the same time, one below the other: (label, values (n,), colour) each."""
    rows = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for axes, (label, values, colour) in zip(rows, panels, strict=True):
        axes.plot(time_s, values, color=colour)
        axes.set_ylabel(label)
        axes.margins(x=0.01)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()


def panel_grid(figure: Figure, count: int, columns: int, x_label: str) -> NDArray[Any]:
    """Axes (rows, columns) at one scale, the first `count` of them seen.

    The lowest of each column have label and numbers on x, those above a gap in the last row too.
    """
    rows = math.ceil(count / columns)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    for axes in grid.flat[max(0, count - columns) : count]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel(x_label)
    return grid


def legend_below(figure: Figure, columns: int = 3, axes: Axes | None = None) -> None:
    """Names below the axes, where they hide nothing; of one pair of axes only, if given."""
    shown = axes.get_legend_handles_labels() if axes is not None else ()
    figure.legend(*shown, loc="outside lower center", ncols=columns)
