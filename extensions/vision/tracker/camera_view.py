"""A camera's newest picture for people, with the tags marked, and figures of how well it sees.

Pictures are made only while they are shown or recorded, and no faster than the page shows them.
They use the station's loopback and never the vehicle's radio (`vehicle_link.topics`).
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Collection

import numpy as np

from console.trackers.camera_figures import CameraPicture, Figures
from extensions.vision.tags.detector import Picture, Tags, marked_picture
from vehicle_link.clock import monotonic_ns
from vehicle_link.topics.table import TOPICS

RECENT_NS = 1_000_000_000
"""Time in ns over which the figures are computed."""
PERIOD_NS = round(0.95e9 / TOPICS["tracker_picture"].rate)
"""Shortest time in ns between two pictures; a little less than the rate's period, for jitter."""


class CameraView:
    """Stores a camera's newest picture and figures; thread-safe.

    Args:
        name: of the camera, if there are several.

    Attributes:
        is_watched: whether pictures are made; set by their sender.
        newest: the newest picture that was made.
    """

    def __init__(self, name: str = "") -> None:
        self.name = name
        self.is_watched = False
        self.newest: CameraPicture | None = None
        self._lock = threading.Lock()
        self._recent: deque[tuple[int, bool, float, float]] = deque()

    def add(
        self, taken_ns: int, grey: Picture, tags: Tags, used: Collection[int], residual: float
    ) -> None:
        """Handle a picture, and the tags found in it.

        Args:
            taken_ns: its time on the host's steady clock.
            used: numbers of the known tags.
            residual: pixels rms; NaN when unknown.
        """
        with self._lock:
            self._recent.append((taken_ns, bool(tags), float(grey.mean()), residual))
            self._forget(taken_ns)
        last = self.newest
        if self.is_watched and (last is None or abs(taken_ns - last.taken_ns) >= PERIOD_NS):
            self.newest = CameraPicture(taken_ns, marked_picture(grey, tags, used))

    def figures(self) -> Figures:
        """Return the present figures of the camera."""
        with self._lock:
            self._forget(monotonic_ns())
            recent = list(self._recent)
        if not recent:
            return Figures(self.name, 0.0)
        _, found, levels, residuals = zip(*recent, strict=True)
        known = [one for one in residuals if math.isfinite(one)]
        return Figures(
            self.name,
            len(recent) / (1e-9 * RECENT_NS),
            sum(found) / len(found),
            levels[-1],
            float(np.median(known)) if known else math.nan,
        )

    def _forget(self, now_ns: int) -> None:
        while self._recent and now_ns - self._recent[0][0] > RECENT_NS:
            self._recent.popleft()
