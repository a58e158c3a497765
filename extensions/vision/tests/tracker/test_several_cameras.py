"""Several cameras are one tracking system: in order, fused, and each missing one told by name."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest

from console.trackers import source_reader
from console.trackers.source import Body, Frame, Source
from extensions.vision.tags.detector import Picture
from extensions.vision.tags.tag_layout import CameraPlace, TagLayout
from extensions.vision.tags.tag_tracker import TagTracker
from extensions.vision.tests.tags.rendered import CAMERA, LAYOUT, LENS, STAND, a_scene
from extensions.vision.tracker import several_cameras
from extensions.vision.tracker.camera import CameraSource
from extensions.vision.tracker.camera_view import CameraView
from extensions.vision.tracker.several_cameras import SeveralCameras, open_cameras
from quadrotor.errors import MeasurementError, QuadlabError, UnreachableError, UsageError
from vehicle_link.clock import monotonic_ns

MS = 1_000_000
COVARIANCE = np.diag(np.repeat([0.002**2, 0.003**2], 3))
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
PLACE = np.array([0.0, 0.1, 0.9])
OTHER = CameraPlace(position=(-2.0, -2.5, 2.2), looks_at=(0.0, 0.0, 0.8))


class Camera:
    """Delivers what is fed, with stamps of its own epoch."""

    def __init__(self, epoch_ns: int, off: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        self.epoch_ns, self.off = epoch_ns, np.array(off)
        self.fed: list[Frame | QuadlabError] = []
        self.news, self.is_open, self.opened = threading.Condition(), True, 0

    def open(self) -> Camera:
        self.opened += 1
        if not self.is_open:
            raise UnreachableError("camera 1 cannot be opened: plug it in")
        return self

    def feed(self, taken_ns: int, late_ns: int = 0) -> None:
        body = Body("cf7", PLACE + self.off, LEVEL, COVARIANCE)
        self.tell(Frame(taken_ns + self.epoch_ns, taken_ns + late_ns, (body,)))

    def tell(self, news: Frame | QuadlabError) -> None:
        with self.news:
            self.fed.append(news)
            self.news.notify()

    def frames(self) -> Iterator[Frame]:
        while True:
            with self.news:
                self.news.wait_for(lambda: bool(self.fed))
                one = self.fed.pop(0)
            if isinstance(one, QuadlabError):
                raise one
            yield one

    def close(self) -> None: ...


@pytest.fixture
def pair() -> Iterator[Callable[..., tuple[SeveralCameras, Camera, Camera]]]:
    opened: list[SeveralCameras] = []

    def make(off: Sequence[float] = (0.0, 0.0, 0.0)) -> tuple[SeveralCameras, Camera, Camera]:
        one, other = Camera(10**18), Camera(-(10**15), off)
        opened.append(SeveralCameras(["0", "1"], [one.open, other.open]))
        return opened[0], one, other

    yield make
    for source in opened:
        source.close()


def test_frames_of_cameras_with_clocks_of_their_own_come_in_the_order_of_their_stamps(
    pair: Callable[..., tuple[SeveralCameras, Camera, Camera]],
) -> None:
    source, one, other = pair()
    frames, began = source.frames(), monotonic_ns()
    got = []
    for k in range(4):
        one.feed(began + 33 * k * MS)
        got.append(next(frames))
        other.feed(began + (33 * k + 16) * MS)
        got.append(next(frames))
    stamps = [(frame.stamp_ns or 0) - began for frame in got]
    assert stamps == [(33 * k + late) * MS for k in range(4) for late in (0, 16)]
    assert {body.name for frame in got for body in frame.bodies} == {"cf7"}
    assert not any(frame.doubt for frame in got)


def test_a_camera_that_is_unplugged_is_told_by_name_and_the_other_goes_on(
    pair: Callable[..., tuple[SeveralCameras, Camera, Camera]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(source_reader, "RETRY", 0.01)
    source, one, other = pair()
    frames = source.frames()
    other.is_open = False
    other.tell(UnreachableError("camera 1 delivers no more pictures: plug it in again"))
    doubt = ""
    for _ in range(200):
        one.feed(monotonic_ns())
        frame = next(frames)
        assert len(frame.bodies) == 1
        doubt = frame.doubt
        if doubt and other.opened > 2:
            break
    assert doubt == "camera 1 cannot be opened: plug it in"
    other.is_open = True
    while doubt:
        one.feed(monotonic_ns())
        other.feed(monotonic_ns())
        doubt = next(frames).doubt


def test_a_black_camera_is_told_by_name_and_without_any_camera_there_are_no_frames(
    pair: Callable[..., tuple[SeveralCameras, Camera, Camera]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(several_cameras, "QUIET_NS", 50 * MS)
    source, one, other = pair()
    frames = source.frames()
    other.tell(MeasurementError("the picture is black"))
    doubt = ""
    while not doubt:
        one.feed(monotonic_ns())
        doubt = next(frames).doubt
    assert doubt == "camera 1: the picture is black"
    one.tell(MeasurementError("the picture is black"))
    with pytest.raises(MeasurementError, match=r"camera 0: the picture is black; camera 1: the"):
        next(frames)


def test_cameras_that_disagree_are_told_with_what_to_do(
    pair: Callable[..., tuple[SeveralCameras, Camera, Camera]],
) -> None:
    source, one, other = pair((0.03, 0.0, 0.04))
    frames, began, doubt = source.frames(), monotonic_ns(), ""
    for k in range(60):
        one.feed(began + 33 * k * MS)
        next(frames)
        other.feed(began + (33 * k + 16) * MS)
        doubt = next(frames).doubt
    assert doubt == (
        "cameras 0 and 1 see cf7 5 cm apart and turned by 0.0°: find their places again, or "
        "calibrate them"
    )


def test_no_camera_is_silent_because_this_program_itself_waited(
    pair: Callable[..., tuple[SeveralCameras, Camera, Camera]], monkeypatch: pytest.MonkeyPatch
) -> None:
    source, one, other = pair()
    frames = source.frames()
    for camera in (one, other):
        camera.feed(monotonic_ns())
        assert next(frames).doubt == ""
    waited_ns = 10_000 * MS
    monkeypatch.setattr(several_cameras, "monotonic_ns", lambda: monotonic_ns() + waited_ns)
    one.feed(monotonic_ns() + waited_ns)
    assert next(frames).doubt == ""


def test_the_end_of_all_videos_is_the_end(
    pair: Callable[..., tuple[SeveralCameras, Camera, Camera]],
) -> None:
    source, one, other = pair()
    frames = source.frames()
    one.tell(UsageError("the video a.avi has ended"))
    other.feed(monotonic_ns())
    assert next(frames).bodies
    other.tell(UsageError("the video b.avi has ended"))
    with pytest.raises(UsageError, match="has ended"):
        next(frames)


class Rendered:
    """Pictures of two tags as a camera at a place sees them, 10 ms apart."""

    def __init__(self, stand: CameraPlace, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.greys = [CAMERA.take(a_scene(PLACE, np.eye(3), stand=stand), random) for _ in range(3)]

    def __iter__(self) -> Iterator[tuple[int | None, int, Picture]]:
        for grey in self.greys:
            yield None, monotonic_ns(), grey
        raise UsageError("the pictures have ended")

    def close(self) -> None: ...


def until_the_end(source: Source) -> Iterator[Frame]:
    """Yield all frames; on a busy computer a detection may take longer than a camera may be quiet.

    Reading goes on after that, as the tracker's process does.
    """
    while True:
        try:
            yield from source.frames()
        except MeasurementError:
            continue
        except UsageError:
            return


def test_two_rendered_cameras_find_the_body_and_each_has_its_picture() -> None:
    places = {"left": STAND, "right": OTHER}
    layout = TagLayout(bodies=LAYOUT.bodies, cameras=places)
    views = [CameraView(name) for name in places]
    for view in views:
        view.is_watched = True

    def camera(k: int) -> CameraSource:
        name = list(places)[k]
        tracker = TagTracker(layout, LENS, name, is_alone=False)
        return CameraSource(Rendered(places[name], k), tracker, views[k])

    source = open_cameras([lambda: camera(0), lambda: camera(1)], list(places))
    frames = list(until_the_end(source))
    source.close()
    assert 0 < len(frames) <= 6  # a late one is dropped on a busy computer
    for frame in frames:
        np.testing.assert_allclose(frame.bodies[0].position_w, PLACE, atol=0.01)
    for view, name in zip(views, places, strict=True):
        assert view.newest is not None
        assert view.figures().name == name


def test_a_camera_without_a_place_is_told_by_name() -> None:
    layout = TagLayout(bodies=LAYOUT.bodies, cameras={"left": STAND})
    with pytest.raises(
        MeasurementError, match=r"no place is given for camera 1: add \[cameras.1\]"
    ):
        TagTracker(layout, LENS, "1", is_alone=False)
    alone = TagLayout(bodies=LAYOUT.bodies, camera=STAND)
    with pytest.raises(MeasurementError, match="no place is given for camera 0"):
        TagTracker(alone, LENS, "0", is_alone=False)
    assert TagTracker(alone, LENS, "0").numbers
