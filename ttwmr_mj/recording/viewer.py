"""Open a recording in the Rerun viewer."""

import subprocess
import sysconfig
from pathlib import Path

from ttwmr_mj.errors import InputError, MachineError


def find_recording(given: Path | None) -> Path:
    """The .rrd a user means: a file, a run folder, or the newest under results/.

    Raises:
        InputError: there is none.
    """
    if given is None:
        found = sorted(Path("results").glob("**/*.rrd"), key=lambda path: path.stat().st_mtime)
        if not found:
            raise InputError("no recording under results/; run a scenario or name an .rrd file")
        return found[-1]
    if given.is_dir():
        inside = sorted(given.glob("*.rrd"))
        if not inside:
            raise InputError(f"{given}: no .rrd file in this folder")
        return inside[0]
    if not given.is_file():
        raise InputError(f"{given}: no such file or folder")
    return given


def open_viewer(given: Path | None) -> int:
    """Show the recording and wait until the viewer is closed; returns its exit code.

    Raises:
        InputError: there is no such recording.
        MachineError: the viewer that comes with rerun-sdk is not installed.
    """
    recording = find_recording(given)
    viewer = Path(sysconfig.get_path("scripts")) / "rerun"
    if not viewer.is_file():
        raise MachineError(f"no Rerun viewer at {viewer}; reinstall it: pip install rerun-sdk")
    return subprocess.run([str(viewer), str(recording)], check=False).returncode
