"""The computations of the reproduction that are no runs of a plant, by name."""

from collections.abc import Callable
from functools import partial
from typing import Any

from ttwmr_mj.studies.reproduce.ideal import continuous, phase_plane, step_size
from ttwmr_mj.studies.reproduce.proofs import proofs

STEP_STUDIES = {f"step-size-{i}": law for i, law in enumerate(step_size.LAWS)}

STUDIES: dict[str, Callable[[], dict[str, Any]]] = {
    "continuous": continuous.study,
    "proofs": proofs.study,
    "phase-plane": phase_plane.study,
    **{name: partial(step_size.study, law) for name, law in STEP_STUDIES.items()},
}
