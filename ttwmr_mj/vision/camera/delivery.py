"""What happens to frames on their way: some never come, some come again, some come late."""

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.options import Delivery


class DeliveryFaults:
    """Passes frames on, or does not; order is kept."""

    def __init__(self, options: Delivery, rng: np.random.Generator) -> None:
        self._options = options
        self._rng = rng
        self._waiting: deque[tuple[int, Frame]] = deque()
        self._last: Frame | None = None
        self._period = 0

    def deliver(self, time_s: float, take: Callable[[], Frame]) -> list[Frame]:
        """The frames that leave the camera in this control period.

        Args:
            time_s: now.
            take: exposes a frame; not called for frames that are lost anyway.
        """
        options, period = self._options, self._period
        self._period += 1
        dropped, frozen, late = self._rng.random(3) < (
            options.dropped,
            options.frozen,
            options.late,
        )
        dark = any(window.contains(time_s) for window in options.blackouts)
        if not dropped and not dark:
            frame = take()
            if frozen and self._last is not None:
                truth = self._last.truth and replace(self._last.truth, time_s=frame.time_s)
                frame = replace(frame, pixels=self._last.pixels, truth=truth)
            self._last = frame
            self._waiting.append((period + (options.late_periods if late else 0), frame))
        ready = []
        while self._waiting and self._waiting[0][0] <= period:
            ready.append(self._waiting.popleft()[1])
        return ready
