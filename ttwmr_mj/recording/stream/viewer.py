"""Rerun's viewer: a window, a page in a browser, or one that runs already; and what to show in it.

Everything that listens for connections does so on loopback only.
"""

import importlib.util
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from ttwmr_mj.errors import InputError, MachineError, cut, shown, whole
from ttwmr_mj.files import holds, require_none_but_files

MAGIC = b"RRF"  # that recordings begin with
LOOPBACK = "127.0.0.1"
WEB_PORT, GRPC_PORT = 9090, 9876  # rerun's own; others where these are taken
PROGRAMS = ("Rerun.app/Contents/MacOS/Rerun", "rerun.exe", "rerun")
ANSWER_S = 5.0
# how HTTP/2 begins (RFC 9113): a client with both, a server with settings
HTTP_2 = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
SETTINGS = bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
# the oldest data go where there is more
SERVER_MEMORY, WINDOW_MEMORY = "1GB", "2GB"
WAYS = "auto, web, or the address of a viewer that runs, such as rerun+http://127.0.0.1:9876/proxy"
NO_DISPLAY_HINT = "look at it in a browser (--web), or copy the file to a machine with a display"


@dataclass(frozen=True, slots=True)
class Viewer:
    """A viewer and how it is started.

    Attributes:
        command: of the process, without what it shows.
        page: address to open in a browser; empty where there is none to open.
        web_port: where that page is served; None where none is.
        stays: it is a window that outlives who opened it.
    """

    command: tuple[str, ...]
    page: str = ""
    web_port: int | None = None
    stays: bool = False


def choose_viewer(wish: str) -> Viewer:
    """The viewer a user wants: "auto", "web", or the address of one that runs.

    Raises:
        InputError: it is none of these, or no viewer answers at the address.
        MachineError: the viewer that comes with rerun-sdk is not installed.
    """
    if wish == "web" or (wish == "auto" and display() is None):
        return web_viewer()
    if wish == "auto":
        return window()
    return running_viewer(wish)


def window() -> Viewer:
    """Rerun's native viewer in a window of its own."""
    limits = ("--memory-limit", WINDOW_MEMORY, "--hide-welcome-screen")
    return Viewer((*_program(), *_at(free_port(GRPC_PORT)), *limits), stays=True)


def web_viewer() -> Viewer:
    """A server of Rerun's web viewer and of the data, both on loopback."""
    web, data = free_port(WEB_PORT), free_port(GRPC_PORT)
    options = ("--serve-web", "--web-viewer-port", str(web), "--server-memory-limit", SERVER_MEMORY)
    page = f"http://{LOOPBACK}:{web}/?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data}%2Fproxy"
    return Viewer((*_program(), *_at(data), *options), page=page, web_port=web)


def running_viewer(url: str) -> Viewer:
    """Feeds a viewer that runs already, here or elsewhere.

    Raises:
        InputError: this is no such address, or nobody answers there.
    """
    try:
        parts = urlsplit(url)
        host, port, path = parts.hostname, parts.port, parts.path
        right = parts.scheme == "rerun+http" and path in ("", "/", "/proxy")
    except ValueError:  # a port that is no number, half an address
        right, host, port = False, None, None
    if not right or not host or not port:
        raise InputError.at("--live", got=shown(url), allowed=WAYS)
    try:
        address = _answering(host, port)
    except (OSError, UnicodeError) as error:  # a name that cannot be one
        hint = f"start one there: rerun --port {port}"
        problem = f"no viewer answers: {getattr(error, 'strerror', None) or error}"
        raise InputError.at("--live", cut(problem), got=shown(url), hint=hint) from error
    return Viewer((*_program(), *_at(port, address)))


def _answering(host: str, port: int) -> str:
    """The address of a server that speaks HTTP/2 as viewers do.

    Raises:
        OSError, UnicodeError: there is none.
    """
    with socket.create_connection((host, port), timeout=ANSWER_S) as connection:
        connection.sendall(HTTP_2 + SETTINGS)
        answer = b""
        while len(answer) < len(SETTINGS) and (more := connection.recv(len(SETTINGS))):
            answer += more
        if answer[3:4] != SETTINGS[3:4]:  # the type of the frame
            raise OSError("what answers there is no viewer")
        return str(connection.getpeername()[0])


def display() -> str | None:
    """The display that windows would open on; None if there is none."""
    if sys.platform in ("win32", "darwin"):
        return sys.platform
    runtime = os.environ.get("XDG_RUNTIME_DIR", "/nonexistent")
    wayland = os.environ.get("WAYLAND_DISPLAY", "")
    if wayland and (Path(runtime) / wayland).exists():
        return f"Wayland {wayland}"
    x11 = os.environ.get("DISPLAY", "")
    host, _, screen = x11.rpartition(":")
    number = whole(screen.partition(".")[0])
    if number is None:
        return None
    if host in ("", "unix"):
        return f"X11 {x11}" if Path(f"/tmp/.X11-unix/X{number}").exists() else None
    return f"X11 {x11}" if listens(6000 + number, host) else None


def free_port(wanted: int) -> int:
    """This port of loopback if nobody has it, else any free one.

    Until this process ends none of our others takes it, as the viewer will do a moment later.
    """
    for port in (wanted, 0, 0, 0):
        with socket.socket() as probe:
            try:
                probe.bind((LOOPBACK, port))
            except OSError:
                continue
            if _reserved(found := int(probe.getsockname()[1])):
                return found
    raise MachineError("no free port on loopback")


_reservations: list[socket.socket] = []


def _reserved(port: int) -> bool:
    """Whether this process has the port among those of ours, by a name that Linux knows."""
    if sys.platform != "linux":
        return True
    mark = socket.socket(socket.AF_UNIX)
    try:
        mark.bind(f"\0ttwmr-port-{port}")
    except OSError:
        mark.close()
        return False
    _reservations.append(mark)
    return True


def listens(port: int, host: str = LOOPBACK) -> bool:
    """Whether someone answers at this port."""
    try:
        socket.create_connection((host, port), timeout=2.0).close()
    except OSError:
        return False
    return True


def _at(port: int, address: str = LOOPBACK) -> tuple[str, ...]:
    return ("--bind", address, "--port", str(port))


def _program() -> tuple[str, ...]:
    """The viewer that comes with rerun-sdk.

    Raises:
        MachineError: it is not installed.
    """
    # the program itself: the script of that name would be a parent that does not pass signals on
    package = importlib.util.find_spec("rerun_cli")
    folder = Path(package.origin).parent if package and package.origin else Path()
    found = [folder / name for name in PROGRAMS if (folder / name).is_file()]
    if not found:
        raise MachineError("no Rerun viewer here; reinstall it: pip install rerun-sdk")
    return (str(found[0]),)


def find_recording(given: Path | None) -> Path:
    """The .rrd a user means: a file, a run folder, or the newest under results/.

    Raises:
        InputError: there is none, or what is there is none.
    """
    recording = _named(given)
    with recording.open("rb") as file:
        if not file.read(len(MAGIC)).startswith(MAGIC):
            raise InputError(f"{recording}: no recording of Rerun, or a damaged one")
    return recording


def _named(given: Path | None) -> Path:
    if given is None:
        found = sorted(_files(Path("results"), "**/*.rrd"), key=lambda path: path.stat().st_mtime)
        if not found:
            raise InputError("no recording under results/; run a scenario or name an .rrd file")
        return found[-1]
    if given.is_dir():
        inside = sorted(_files(given, "*.rrd"))
        if not inside:
            for path in sorted(given.glob("*.rrd")):
                require_none_but_files(path, hint="")
            raise InputError(f"{given}: no .rrd file in this folder")
        return inside[0]
    if not holds(given.parent, given.name):
        raise InputError(f"{given}: no such file or folder")
    return given


def _files(folder: Path, pattern: str) -> Iterator[Path]:
    """Those that can be read to their end, and no pipes of such names."""
    return (path for path in folder.glob(pattern) if path.is_file())


def open_window(given: Path | None) -> int:
    """Show the recording in a window and wait until it is closed; returns the exit code.

    Raises:
        InputError: there is no such recording.
        MachineError: there is no viewer, or no display to open it on.
    """
    recording = find_recording(given)
    if display() is None:
        raise MachineError(f"no display to show {recording} on; {NO_DISPLAY_HINT}")
    name = str(recording.absolute())  # in full it is no address and no option to the viewer
    return subprocess.run([*window().command, name], check=False).returncode
