"""What the colours mean: a strip of samples with their names, below the scene."""

from collections.abc import Sequence

import numpy as np
import rerun as rr

from ttwmr_mj.recording import style
from ttwmr_mj.recording.style import Colour

KEY = "key"
KEY_SIZE = (120.0, 5.0)  # width and height of the strip, in units of its own
SAMPLE = 4.0  # length of a sample
SAMPLE_DEPTH, NAME_DEPTH = 2.5, 1.1  # the viewer writes a name below its point
NAME_GAP, HALF_LETTER = 2.0, 0.42  # from a sample to its name, whose middle is what is placed
Entry = tuple[str, Colour, float]  # name, colour, width of the line in points on the screen

REFERENCE: Entry = ("reference", style.REFERENCE_BAND, 3.5)
TRACTOR: Entry = ("tractor, P", style.TRACTOR, 1.2)
TRAILER: Entry = ("trailer, COM", style.TRAILER, 1.2)
MISS: Entry = ("off reference", style.ALERT, 1.6)
ESTIMATE: Entry = ("estimated", style.ESTIMATE, 1.2)


def draw_key(stream: rr.RecordingStream, entries: Sequence[Entry]) -> None:
    """Log the strip, its entries side by side."""
    names, colours, widths = zip(*entries, strict=True)
    lengths = np.array([SAMPLE + NAME_GAP + 2.0 * HALF_LETTER * len(name) for name in names])
    room = (KEY_SIZE[0] - lengths.sum()) / len(entries)
    left = np.cumsum(lengths + room) - lengths - 0.5 * room
    middle = left + 0.5 * (SAMPLE + NAME_GAP + lengths)  # of the names
    samples = rr.LineStrips2D(
        [[[x, SAMPLE_DEPTH], [x + SAMPLE, SAMPLE_DEPTH]] for x in left],
        colors=colours,
        radii=rr.Radius.ui_points(widths),
    )
    labels = rr.Points2D(
        np.column_stack([middle, np.full(len(names), NAME_DEPTH)]),
        # in the colours themselves they could not be read in a browser that likes it light
        colors=[style.WORDS],
        radii=rr.Radius.ui_points([0.0]),
        labels=names,
        show_labels=True,
    )
    stream.log(f"{KEY}/samples", samples, static=True)
    stream.log(f"{KEY}/names", labels, static=True)
