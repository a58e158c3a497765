"""Several fixed cameras as one tracking system.

Each camera is read in its own thread, which opens it again each second while it is missing. Stamps
are mapped onto the host's clock, one mapping a camera, frames are put in order, and each body's
poses are fused (`extensions.vision.tags.camera_fusion`).
"""

from __future__ import annotations

import math
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

from console.trackers.source import Body, Frame, Source
from console.trackers.source_reader import SourceReader
from console.trackers.system_clock import SystemClock
from extensions.vision.tags.camera_fusion import BodyPose, CameraFusion
from extensions.vision.tracker.camera import CameraSource
from extensions.vision.tracker.in_order import InOrder
from quadrotor.errors import MeasurementError, QuadlabError, UsageError
from vehicle_link.clock import monotonic_ns

QUIET_NS, STARTING_NS = 500_000_000, 5_000_000_000
"""Time in ns without news after which a camera is reported, and for which it may start."""
KEPT = 64
LOOK_NS = 20_000_000
"""Longest time in ns between two looks at what is due."""
MOST_COUNTED_NS = 5 * LOOK_NS
"""Longest time in ns between two looks that counts as silence of a camera.

Where this program itself waited for longer, pictures may be waiting for it.
"""


class _News(NamedTuple):
    """A frame of a camera, or why there is none."""

    camera: int
    frame: Frame | Exception


class SeveralCameras:
    """Bodies with tags, as seen by several cameras.

    Args:
        names: of the cameras, for messages.
        openers: connect to one camera each; may raise QuadlabError, and are then tried again.
    """

    def __init__(self, names: Sequence[str], openers: Sequence[Callable[[], Source]]) -> None:
        self._names = names
        self._news: queue.Queue[_News] = queue.Queue(KEPT)
        self._closed = threading.Event()
        self._clocks = [SystemClock() for _ in names]
        self._order: InOrder[tuple[int, Frame]] = InOrder(len(names))
        self._fusions: dict[str, CameraFusion] = {}
        self._troubles: dict[int, str] = {}
        self._looked_ns, self._listened_ns = monotonic_ns(), 0
        self._heard_ns = [STARTING_NS] * len(names)  # in time that this program listened for
        self._ended: set[int] = set()
        self._readers = [
            SourceReader(f"camera {name}", one, partial(self._tell, k))
            for k, (name, one) in enumerate(zip(names, openers, strict=True))
        ]

    def frames(self) -> Iterator[Frame]:
        """Yield the frames of all cameras; what is wrong with some of them is a frame's doubt.

        Raises MeasurementError while no camera works, UsageError when all videos have ended.
        """
        quiet_ns = self._listened_ns
        while not self._closed.is_set():
            now_ns = self._look()
            due_ns = self._order.due_ns(now_ns)
            wait_ns = LOOK_NS if due_ns is None else min(LOOK_NS, max(0, due_ns - now_ns))
            try:
                news = self._news.get(timeout=1e-9 * wait_ns)
            except queue.Empty:
                pass
            else:
                self._look()
                self._heard_ns[news.camera] = self._listened_ns
                if isinstance(news.frame, Frame):
                    quiet_ns = self._listened_ns
                    self._put(news.camera, news.frame)
                else:
                    self._note(news.camera, news.frame)
            for camera, frame in self._order.due(monotonic_ns()):
                yield self._fused(camera, frame)
            if self._listened_ns - quiet_ns > QUIET_NS and (doubt := self._doubt()):
                raise MeasurementError(doubt)

    def _look(self) -> int:
        """Count the time listened for; return the host's time, ns."""
        now_ns = monotonic_ns()
        self._listened_ns += min(now_ns - self._looked_ns, MOST_COUNTED_NS)
        self._looked_ns = now_ns
        return now_ns

    def close(self) -> None:
        self._closed.set()
        for one in self._readers:
            one.close()

    def _tell(self, camera: int, news: Frame | Exception) -> None:
        self._news.put(_News(camera, news))

    # ------------------------------------------------------------------ the reader's thread
    def _put(self, camera: int, frame: Frame) -> None:
        self._troubles.pop(camera, None)
        taken_ns: int | None = frame.received_ns
        if frame.stamp_ns is not None:
            taken_ns = self._clocks[camera].host_ns(frame.stamp_ns, frame.received_ns)
        if taken_ns is None:
            self._troubles[camera] = "its clock may have been set"
            return
        # Fused frames are stamped with the host's clock, of which the process finds no offset.
        frame = frame._replace(stamp_ns=None if frame.stamp_ns is None else taken_ns)
        self._order.put(camera, taken_ns, (camera, frame), monotonic_ns())

    def _note(self, camera: int, error: Exception) -> None:
        if not isinstance(error, QuadlabError):
            raise error
        self._troubles[camera] = str(error)
        if isinstance(error, UsageError):
            self._ended.add(camera)
            if len(self._ended) == len(self._names):
                raise error

    def _fused(self, camera: int, frame: Frame) -> Frame:
        taken_ns = frame.received_ns if frame.stamp_ns is None else frame.stamp_ns
        bodies = []
        for body in frame.bodies:
            fusion = self._fusions.setdefault(body.name, CameraFusion(len(self._names)))
            assert body.quaternion_wb is not None
            assert body.covariance is not None
            seen = BodyPose(body.position_w, body.quaternion_wb, body.covariance)
            found = fusion.take(camera, taken_ns, seen)
            if found is not None:
                bodies.append(Body(body.name, *found))
        return frame._replace(bodies=tuple(bodies), doubt=self._doubt())

    def _doubt(self) -> str:
        """Return what is wrong with single cameras, or between them, in one line."""
        told = []
        for camera, name in enumerate(self._names):
            words = self._troubles.get(camera, "")
            silent_ns = self._listened_ns - self._heard_ns[camera]
            if not words and silent_ns > QUIET_NS:
                words = f"no picture for {1e-9 * silent_ns:.1f} s; check its cable"
            if words:
                told.append(words if words.startswith("camera ") else f"camera {name}: {words}")
        for body, fusion in self._fusions.items():
            told += disagreements_of(body, fusion, self._names)
        return "; ".join(told)


def disagreements_of(body: str, fusion: CameraFusion, names: Sequence[str]) -> list[str]:
    """Return a line for each two cameras that disagree about a body, and what to do."""
    return [
        f"cameras {names[one]} and {names[other]} see {body} {1e2 * apart:.0f} cm apart and turned "
        f"by {math.degrees(turned):.1f}°: find their places again, or calibrate them"
        + (f"; camera {names[max(left)]} is left out" if (left := fusion.left_out) else "")
        for (one, other), apart, turned in fusion.disagreements()
    ]


def open_cameras(sources: Sequence[Callable[[], CameraSource]], names: Sequence[str]) -> Source:
    """Return one camera as it is, or several as one system. Raises QuadlabError."""
    return sources[0]() if len(sources) == 1 else SeveralCameras(names, sources)
