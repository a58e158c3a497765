"""A camera, or a video file, as a tracking system: tags on the bodies, read by OpenCV.

OpenCV gives the driver's stamp of a buffer under V4L2 (opencv/opencv, pull request 740), and a
picture's time in a file.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from console.trackers.source import Body, Frame
from extensions.vision.tags.detector import Picture, Tags
from extensions.vision.tags.intrinsics import Intrinsics, load_intrinsics
from extensions.vision.tags.tag_layout import CameraPlace, load_tags, name_of
from extensions.vision.tags.tag_tracker import TagTracker
from extensions.vision.tracker.camera_view import CameraView
from quadrotor.errors import StorageError, UnreachableError, UsageError
from vehicle_link.clock import monotonic_ns

MS = 1_000_000
LATEST_NS = 200 * MS
"""Age in ns beyond which pictures of a file are skipped: a reader that is slower than the video
gets the newest one."""


class PictureStream(Protocol):
    """Pictures as they come: driver's stamp in ns or None, host's steady clock in ns, grey."""

    def __iter__(self) -> Iterator[tuple[int | None, int, Picture]]: ...

    def close(self) -> None: ...


class TagSource(ABC):
    """A camera, or a video file, with tags in its pictures.

    Args:
        pictures: read, and closed with the source.
        view: receives each picture after its frame was processed.
        late_ns: from the middle of the exposure to the driver's stamp.
    """

    def __init__(self, pictures: PictureStream, view: CameraView, late_ns: int = 0) -> None:
        self._pictures, self._view, self._late_ns = pictures, view, late_ns

    def frames(self) -> Iterator[Frame]:
        """Yield one frame per picture. Raises MeasurementError, UnreachableError, UsageError."""
        for stamp_ns, received_ns, grey in self._pictures:
            taken_ns = received_ns - self._late_ns
            late = None if stamp_ns is None else stamp_ns - self._late_ns
            try:
                frame = self._read(grey, taken_ns if late is None else late)
                yield frame._replace(stamp_ns=late, received_ns=taken_ns)
            finally:  # also for a refused picture, which shows why
                self._view.add(taken_ns, grey, *self._seen())

    @abstractmethod
    def _read(self, grey: Picture, taken_ns: int) -> Frame:
        """Return the content of a picture taken at that time, of any epoch, without its stamps.
        Raises MeasurementError.
        """

    @abstractmethod
    def _seen(self) -> tuple[Tags, Collection[int], float]:
        """Return the tags of the newest picture, the numbers of the known ones, and their deviation
        from their places, pixels rms.
        """

    def close(self) -> None:
        self._pictures.close()


class CameraSource(TagSource):
    """Bodies with tags, as seen by one camera."""

    def __init__(self, pictures: PictureStream, tracker: TagTracker, view: CameraView) -> None:
        super().__init__(pictures, view)
        self._tracker = tracker
        self._told: CameraPlace | None = None

    @classmethod
    def open(
        cls,
        camera: int | Path,
        intrinsics: Path,
        tags: Path,
        view: CameraView | None = None,
        *,
        is_alone: bool = True,
    ) -> CameraSource:
        """Open a camera.

        Args:
            camera: a device's number, or a video file, which is played at its own speed.
            intrinsics, tags: files of the camera's intrinsics and of the layout of the tags.
            view: for people.
            is_alone: whether it is the only camera.

        Raises StorageError, MeasurementError, UnreachableError.
        """
        lens = load_intrinsics(intrinsics)
        tracker = TagTracker(load_tags(tags), lens, name_of(camera), is_alone=is_alone)
        return cls(Pictures(camera, lens), tracker, view or CameraView())

    def _read(self, grey: Picture, taken_ns: int) -> Frame:
        bodies, place = self._tracker.take(grey), self._tracker.found_place
        if place is not None and place is not self._told:
            self._told = place
            print(
                "tracker: the world's tags give a camera's pose; add it to the file of tags: "
                f"cameras.{self._tracker.camera} = {place.text}",
                flush=True,
            )
        return Frame(None, 0, tuple(Body(name, *pose) for name, pose in bodies.items()))

    def _seen(self) -> tuple[Tags, Collection[int], float]:
        return self._tracker.tags, self._tracker.numbers, self._tracker.residual


class Pictures:
    """The pictures of a device or a video file, a `PictureStream`.

    Raises StorageError or UnreachableError when the camera cannot be opened, UnreachableError when
    it delivers no more pictures, UsageError when the file has ended.
    """

    def __init__(self, camera: int | Path, lens: Intrinsics | None = None) -> None:
        self._camera = camera
        self._closed = threading.Event()
        self._first: tuple[int, int] | None = None
        if isinstance(camera, Path):
            if not camera.is_file():
                raise StorageError(f"no video {camera}; give an existing file")
            self._capture = cv2.VideoCapture(str(camera))
        else:
            self._capture = cv2.VideoCapture(camera)
            if lens is not None:
                self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, lens.width)
                self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, lens.height)
        if not self._capture.isOpened():
            raise UnreachableError(
                f"OpenCV cannot read the video {camera}; convert it to MP4 or AVI"
                if isinstance(camera, Path)
                else f"camera {camera} cannot be opened: plug it in, check whether another program "
                f"uses /dev/video{camera}, or give another --device"
            )

    def __iter__(self) -> Iterator[tuple[int | None, int, Picture]]:
        while not self._closed.is_set():
            grabbed = self._capture.grab()
            received_ns = monotonic_ns()
            if not grabbed:
                raise self._end()
            stamp_ns = round(MS * self._capture.get(cv2.CAP_PROP_POS_MSEC))
            if isinstance(self._camera, Path):
                if self._due_ns(stamp_ns, received_ns) < received_ns - LATEST_NS:
                    continue  # a camera's buffer would be overwritten by now
                received_ns = self._paced(stamp_ns, received_ns)
            decoded, picture = self._capture.retrieve()
            if not decoded:
                raise self._end()
            grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
            yield stamp_ns or None, received_ns, np.asarray(grey, np.uint8)

    def close(self) -> None:
        self._closed.set()

    def _end(self) -> Exception:
        if isinstance(self._camera, Path):
            return UsageError(f"the video {self._camera} has ended")
        self._capture.release()
        return UnreachableError(
            f"camera {self._camera} delivers no more pictures: plug it in again, or check its cable"
        )

    def _paced(self, stamp_ns: int, now_ns: int) -> int:
        """Wait until a picture of a file is due and return the time."""
        self._closed.wait(max(0.0, 1e-9 * (self._due_ns(stamp_ns, now_ns) - now_ns)))
        return monotonic_ns()

    def _due_ns(self, stamp_ns: int, now_ns: int) -> int:
        """Return when a picture of a file is due; the first one is due now."""
        if self._first is None:
            self._first = stamp_ns, now_ns
        return self._first[1] + stamp_ns - self._first[0]
