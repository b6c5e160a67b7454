"""OpenCV on one thread while a camera runs or is calibrated; its threads are given back."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import cv2

_lock = Lock()
_running = 0  # cameras
_before = 0  # threads that OpenCV had


def keep_to_one() -> None:
    """OpenCV works in the thread that asks it; for each call, `give_back` must be called once."""
    global _running, _before  # so is OpenCV's number
    with _lock:
        _running += 1
        if _running == 1:
            _before = cv2.getNumThreads()
            cv2.setNumThreads(1)


def give_back() -> None:
    """OpenCV may use as many threads as before, once no camera runs."""
    global _running
    with _lock:
        _running -= 1
        if _running == 0:
            cv2.setNumThreads(_before)


@contextmanager
def one_thread() -> Iterator[None]:
    """While it lasts OpenCV sums in one order, so that the same input gives the same bits."""
    keep_to_one()
    try:
        yield
    finally:
        give_back()
