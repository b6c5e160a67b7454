"""What this machine has, what is missing, and how to install it."""

import ctypes.util
import os
import platform
import re
from importlib import import_module
from importlib.metadata import requires, version
from pathlib import Path

from ttwmr_mj.errors import cut, described
from ttwmr_mj.files import importing_matplotlib
from ttwmr_mj.recording.stream.viewer import display
from ttwmr_mj.runs.files.folder import library_version
from ttwmr_mj.vision.camera.rendering.gl import ANY, BACKENDS, DEBIAN_PACKAGES, asked_backend, probe

# extra → the distribution that it is for
EXTRAS = {
    "planning": "casadi",
    "reproduce": "sympy",
    "video": "imageio-ffmpeg",
    "cluster": "distributed",
}
# what they are imported as; MuJoCo by our own door, past what lies in the working directory
MODULES = {
    "mujoco": "ttwmr_mj.plants.model.engine",
    "opencv-python-headless": "cv2",
    "rerun-sdk": "rerun",
}
VULKAN_DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))


def examine() -> tuple[str, bool]:
    """A report in words, and whether everything a truth-sensing run needs is there.

    Rendering and the viewer are optional: their absence is reported, but is not a failure.
    """
    versions = {name: library_version(name) for name in _required()}
    broken = {name: fault for name in versions if versions[name] and (fault := _fault_of(name))}
    missing = [name for name, found in versions.items() if found is None or name in broken]
    python = f"Python {platform.python_version()}, {platform.platform()}"
    lines = [f"ttwmr-mj {version('ttwmr-mj')}, {python}", f"processors: {os.cpu_count()}", ""]
    lines += ["Libraries", *(f"  {n:24s} {found or 'MISSING'}" for n, found in versions.items())]
    lines += [f"  {name} CANNOT BE IMPORTED: {fault}" for name, fault in broken.items()]
    if missing:
        lines.append(f"  install them: pip install {' '.join(missing)}")
    lines += ["", "Extras, each for what it is named after", *_extras()]
    lines += ["", "OpenGL, to render camera frames (not needed with truth sensing)", *_opengl()]
    lines += ["", "Display, for windows (not needed to record)", *_display()]
    lines += ["", "Vulkan, for the Rerun viewer (not needed to record)", *_vulkan()]
    if variables := _variables():
        lines += ["", "Environment", *variables]
    return "\n".join(lines), not missing


def _required() -> list[str]:
    """Names of the distributions this package cannot do without."""
    wanted = [line for line in requires("ttwmr-mj") or [] if "extra ==" not in line]
    return [re.split(r"[<>=!~ ;\[]", line, maxsplit=1)[0] for line in wanted]


def _fault_of(name: str) -> str:
    """Why an installed distribution cannot be imported; empty if it can."""
    try:
        with importing_matplotlib():
            module = import_module(MODULES.get(name, name.replace("-", "_")))
    except Exception as error:  # a library that is damaged may raise anything
        return cut(described(error).splitlines()[0])
    return "" if module.__file__ else "its folder holds no code"


def _extras() -> list[str]:
    """What the user's extras bring, and how to install those that are missing."""
    lines = []
    for extra, name in EXTRAS.items():
        found = library_version(name)
        if found is None:
            found = f"missing: pip install 'ttwmr-mj[{extra}]'"
        elif fault := _fault_of(name):
            found = f"{found}, but cannot be imported: {fault}"
        lines.append(f"  {extra:11s} {name:14s} {found}")
    return lines


def _opengl() -> list[str]:
    found = {backend: probe(backend) for backend in BACKENDS}
    works = [backend for backend, one in found.items() if one.renderer]
    able = f"yes, by {works[0]}; one that works is enough" if works else "no"
    lines = [f"  camera frames: {able}"]
    lines += [f"  {b:8s} {p.renderer or 'does not work: ' + p.fault}" for b, p in found.items()]
    if not works:
        lines.append(f"  install it: apt-get install {' '.join(DEBIAN_PACKAGES)}")
    asked = asked_backend()
    if asked not in (*BACKENDS, *ANY) or (asked in found and found[asked].renderer is None):
        allowed = ", ".join(works) or "none"
        lines.append(
            f"  MUJOCO_GL={asked} ends camera runs, and no others; unset it, or set what works "
            f"here: {allowed}"
        )
    return lines


def _variables() -> list[str]:
    """Those of the environment that libraries obey, and results must not."""
    told = {"RERUN": "output.recording decides", "MPLBACKEND": "figures are files"}
    found = {name: os.environ[name] for name in told if name in os.environ}
    return [f"  {name}={value} changes nothing: {told[name]}" for name, value in found.items()]


def _display() -> list[str]:
    if (found := display()) is not None:
        return [f"  {found}"]
    return ["  none: watch in a browser, with ttwmr view --web or ttwmr run --live=web"]


def _vulkan() -> list[str]:
    drivers = [path.name for folder in VULKAN_DRIVERS for path in sorted(folder.glob("*.json"))]
    loader = ctypes.util.find_library("vulkan")
    if loader and drivers:
        return [f"  {loader}, drivers: {', '.join(drivers)}"]
    have = loader or "no loader"
    return [
        f"  {have}, drivers: {', '.join(drivers) or 'none'}",
        "  install it: apt-get install libvulkan1 mesa-vulkan-drivers",
    ]
