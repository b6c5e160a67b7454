"""An .rrd file as the recorders write it: opened, streamed to, and closed whatever happens."""

from __future__ import annotations

import os
from contextlib import nullcontext, suppress
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, Self
from uuid import uuid4

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from ttwmr_mj.errors import InputError, MachineError, RunError, refused
from ttwmr_mj.files import variable
from ttwmr_mj.recording.layout import REPORT
from ttwmr_mj.recording.stream.outlet import Outlet
from ttwmr_mj.recording.words import drawable

if TYPE_CHECKING:
    from ttwmr_mj.recording.stream.live import LiveView

APPLICATION = "ttwmr"

if hasattr(os, "register_at_fork"):  # a child cannot flush the streams that its parent has left
    os.register_at_fork(before=rerun_bindings.flush_and_cleanup_orphaned_recordings)


class RrdFile:
    """Base of what writes recordings; a context manager that closes the file on any way out.

    Args:
        path: the .rrd file, overwritten; its folder exists.
        name: of the recording, as the viewer lists it.
        layout: what the viewer shows; None where that is known later (`_show`).
        live: shows the file while it is written.
        footer: end the file with a table of its contents, by which readers jump in it; Rerun keeps
            it in memory meanwhile, some 0.1 MB for each second of work.

    Raises:
        InputError: the file cannot be created.
        RunError: its folder is gone.
        MachineError: the clock is before 1970.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        layout: rrb.Blueprint | None,
        live: LiveView | None = None,
        *,
        footer: bool = True,
    ) -> None:
        if time() < 0.0:  # Rerun would panic
            raise MachineError(
                "this machine's clock is before 1970, and no recording can begin there; set the "
                "clock, or leave the recording out (output.recording=false)"
            )
        rr.set_strict_mode(True)  # else wrong calls only warn
        with variable("RERUN", None):  # off: it would write nothing; `output.recording` decides
            self._stream = rr.RecordingStream(
                APPLICATION, recording_id=uuid4(), send_properties=False
            )
            self._stream.set_log_time_enabled(False)
            try:
                self._outlet = Outlet(path)
            except (FileNotFoundError, NotADirectoryError) as error:
                raise RunError(f"{path.parent}: the folder is gone") from error
            except OSError as error:
                raise InputError(
                    f"{path}: cannot be written as a recording: {refused(error)}"
                ) from error
            self._stream.save(self._outlet.name, write_footer=footer)
        self._outlet.opened()
        if layout is not None:
            self._show(layout, make_active=False)
        self._open = True
        self._live = live
        if live is not None:
            live.follow(path)
        self._stream.send_recording_name(name)

    def flush(self) -> None:
        """Bring to the file what has been added.

        Raises:
            OSError: the file cannot be written.
        """
        self._stream.flush()
        self._outlet.take()

    def close(self) -> None:
        """Complete the file; nothing can be appended afterwards. A second call does nothing.

        Raises:
            OSError: the file could not be written to its end.
        """
        if not self._open:
            return
        self._open = False
        self._stream.disconnect()
        # the stream's threads outlive it otherwise
        rerun_bindings.flush_and_cleanup_orphaned_recordings()
        try:
            self._outlet.close()
        finally:
            if self._live is not None:
                self._live.finish()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with suppress(OSError) if kind else nullcontext():  # the first fault is told
            self.close()

    def _report(self, markdown: str, path: str = REPORT) -> None:
        """Show this in a text panel, instead of what it shows now."""
        document = rr.TextDocument(drawable(markdown), media_type=rr.MediaType.MARKDOWN)
        self._stream.log(path, document, static=True)

    def _show(self, layout: rrb.Blueprint, *, make_active: bool = True) -> None:
        """Let the viewer show this from now on.

        Rerun's own `send_blueprint` leaves a stream behind, with two threads and what it held: the
        stream and the memory it was written to hold each other. Here its end is disconnected.
        """
        with variable("RERUN", None):
            drawn = rr.RecordingStream._from_native(
                rerun_bindings.new_blueprint(
                    application_id=APPLICATION,
                    make_default=False,
                    make_thread_default=False,
                    default_enabled=True,
                )
            )
            drawn.set_time("blueprint", sequence=0)
            layout.to_blueprint()._log_to_stream(drawn)
            rerun_bindings.send_blueprint(
                drawn.memory_recording().storage,
                make_active=make_active,
                make_default=True,
                recording=self._stream.to_native(),
            )
            drawn.disconnect()

    def _check_open(self) -> None:
        if not self._open:  # rerun would drop the data with a warning
            raise ValueError("the recording is closed, nothing can be added to it")
