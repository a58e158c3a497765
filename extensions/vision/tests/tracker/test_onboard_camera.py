"""`quadlab tracker onboard_camera`: from a video to the vehicle's bearings."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from bearing_sim import BearingParameters
from bearing_sim.beacons import parse_layout
from console.trackers.bearings import BearingsTracker
from console.trackers.camera_figures import figures_text
from console.trackers.source import Frame
from extensions.vision.simulated.onboard_camera import OnboardCamera
from extensions.vision.simulated.parameters import CameraParameters
from extensions.vision.tags.tag_bearings import Places
from extensions.vision.tracker.camera_view import CameraView
from extensions.vision.tracker.onboard_camera import OnboardCameraSource, StationBeacons
from quadlab.commands.processes import check_tracker
from quadlab.commands.tracker import Tracker
from quadrotor.errors import MeasurementError, UsageError
from quadrotor.records import beacon_ids_of
from tests.console.trackers.test_tracker_process import AHEAD_NS, Bench
from tests.waiting import wait_for
from vehicle_link.messages import decode, encode, new
from vehicle_link.topics.measurements import PICTURE, decode_bearings, decode_picture
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node

Array = npt.NDArray[np.float64]

PLACE = np.array([0.3, -0.2, 1.1])
WALL = parse_layout("wall")
BEACONS = dict(zip(WALL.ids.tolist(), WALL.positions_w.tolist(), strict=True))
TAGS = "size = 0.2\n[camera]\nposition = [0.05, 0, -0.03]\nturn = [0, -90, 0]\n"
PICTURES, RATE = 120, 4.0


class Notification:
    def __init__(self, places: Places) -> None:
        self.places = places
        self.position_w: Array | None = None

    def close(self) -> None: ...


@cache
def camera() -> OnboardCamera:
    """Return the camera that makes the pictures; its lens takes a moment to compute."""
    parameters = BearingParameters(layout="wall", mount_pitch=-90.0)
    return OnboardCamera(parameters, CameraParameters(exposure=0.0))


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with intrinsics, tags and a video of a hovering vehicle."""
    folder = tmp_path_factory.mktemp("camera")
    camera().lens.save(folder / "camera.yaml")
    (folder / "beacons.toml").write_text(TAGS)
    grey = camera().picture(PLACE, np.eye(3), np.zeros(3), np.zeros(3))
    write(folder / "hover.avi", [grey] * PICTURES)
    return folder


def write(path: Path, pictures: list[Any], rate: float = RATE) -> None:
    size = pictures[0].shape[::-1]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate, size)
    for grey in pictures:
        writer.write(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    writer.release()


def first(files: Path, video: str, places: Places) -> Frame:
    source = OnboardCameraSource(
        files / video, files / "camera.yaml", files / "beacons.toml", Notification(places)
    )
    return next(source.frames())


def true_bearings() -> Array:
    away = WALL.positions_w - PLACE
    return np.asarray(away / np.linalg.norm(away, axis=1)[:, None])


def test_a_picture_that_fits_the_layout_is_not_doubted_and_one_that_does_not_is(
    files: Path,
) -> None:
    frame = first(files, "hover.avi", BEACONS)
    assert frame.beacons is not None
    np.testing.assert_allclose(frame.beacons.bearings_b, true_bearings(), atol=2e-3)
    assert frame.doubt == ""
    moved = {**BEACONS, 2: [2.5, -1.1, 0.6]}
    doubted = first(files, "hover.avi", moved)
    assert "pixels from their places in the layout" in doubted.doubt
    assert doubted.beacons is not None
    assert doubted.beacons.beacon_ids == [1, 2, 3, 4]  # passed on, to survey them


def test_a_black_picture_is_told_and_the_next_one_read(files: Path) -> None:
    grey = camera().picture(PLACE, np.eye(3), np.zeros(3), np.zeros(3))
    write(files / "dark.avi", [np.zeros_like(grey), grey])
    source = OnboardCameraSource(
        files / "dark.avi", files / "camera.yaml", files / "beacons.toml", Notification(BEACONS)
    )
    with pytest.raises(MeasurementError, match="the picture is black"):
        next(source.frames())
    seen = next(source.frames()).beacons
    assert seen is not None
    assert seen.beacon_ids == [1, 2, 3, 4]


def test_leds_in_a_video_are_the_beacons_whose_blinks_the_file_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "extensions.vision.tracker.camera.LATEST_NS", 1 << 60
    )  # skip none on a busy computer
    parameters = BearingParameters(layout="wall", mount_pitch=-90.0)
    camera = OnboardCamera(parameters, CameraParameters(exposure=0.0, markers="leds"))
    still = PLACE, np.eye(3), np.zeros(3), np.zeros(3)
    pictures = [camera.picture(*still, round(1e9 * k / 30.0)) for k in range(32)]
    write(tmp_path / "leds.avi", pictures, 30.0)
    camera.lens.save(tmp_path / "camera.yaml")
    leds = "[leds]\n1 = 2.0\n2 = 3.0\n3 = 4.0\n4 = 5.0\n"
    (tmp_path / "leds.toml").write_text(leds + TAGS.removeprefix("size = 0.2\n"))
    source = OnboardCameraSource(
        tmp_path / "leds.avi",
        tmp_path / "camera.yaml",
        tmp_path / "leds.toml",
        Notification(BEACONS),
    )
    seen = (frame.beacons for frame in source.frames())
    found = next(one for one in seen if one is not None and one.beacon_ids)
    assert found.beacon_ids == [1, 2, 3, 4]
    np.testing.assert_allclose(found.bearings_b, true_bearings(), atol=1e-3)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ({}, "onboard_camera needs --tags FILE"),
        ({"body": ("a", "b")}, "is on one vehicle"),
        ({"body": ("quad1=b",)}, "is on one vehicle"),
    ],
)
def test_words_that_do_not_go_together_are_refused(words: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        Tracker("onboard_camera", **words).check()


def test_the_station_does_not_start_it_for_poses() -> None:
    with pytest.raises(UsageError, match="provides bearings and no poses"):
        check_tracker("onboard_camera --intrinsics c --tags t")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    bench = Bench(tmp_path_factory.mktemp("data"))
    yield bench
    bench.close()


def test_a_video_becomes_the_vehicles_bearings_and_its_end_frees_the_station(
    bench: Bench, files: Path
) -> None:
    statuses: list[Any] = []
    pictures: list[bytes] = []
    type_name = TOPICS["camera_status"].type_name
    bench.page.subscribe(
        "camera_status", type_name, lambda r: statuses.append(decode(r.payload, type_name))
    )
    session, ending = bench.page.session, threading.Event()

    def source() -> OnboardCameraSource:
        beacons = StationBeacons(session, "quad1")
        return OnboardCameraSource(
            files / "hover.avi", files / "camera.yaml", files / "beacons.toml", beacons, view
        )

    view = CameraView()
    tracker = BearingsTracker("a camera", source, {"quad1": "quad1"}, session, views=[view])
    thread = threading.Thread(target=tracker.run, args=(ending,), daemon=True)
    thread.start()
    wait_for(lambda: len(bench.frames) > 5)
    newest = bench.frames[-1]
    frame = decode_bearings(newest.payload)
    assert beacon_ids_of(frame) == [1, 2, 3, 4]
    np.testing.assert_allclose(frame["bearing_b"][0, :4], true_bearings(), atol=2e-3)
    age = 1e-9 * (newest.received_ns + AHEAD_NS - int(frame["stamp_ns"][0]))
    assert -0.005 < age < 1.0
    # The station's beacons are on the floor, in its own layout.
    wait_for(lambda: bench.told("pixels from their places in the layout"))
    wait_for(lambda: len(statuses[-1].seen) == 4)
    assert sorted(statuses[-1].seen) == [f"beacon {number}" for number in (1, 2, 3, 4)]
    assert not view.is_watched  # and no picture was made
    assert view.newest is None
    watching = Node(session, "/quad1", "page")
    watching.subscribe(
        "camera_picture", PICTURE, lambda r: pictures.append(decode_picture(r.payload))
    )
    wait_for(lambda: pictures)
    watching.close()
    wait_for(lambda: not view.is_watched)
    [figures] = statuses[-1].cameras
    assert figures.tags_share == 1.0
    assert figures.residual > 3.0  # pixels: the layout is another
    words = figures_text(figures, "beacons")
    assert re.fullmatch(
        r"\d pictures/s, mean grey level \d+ of 255, beacons in 100% of them, \d+\.\d\d pixels "
        "from their places",
        words,
    )
    ending.set()
    thread.join(20)
    wait_for(lambda: bench.told("camera on board: its process was ended"))
    assert bench.station.parts.tracker.camera_alarm, (
        "while it is not known that the vehicle is disarmed"
    )
    disarmed = encode(new("quadlab_msgs/VehicleStatus", armed=False))
    publisher = bench.at_vehicle.advertise(TOPICS["status"])

    def is_freed() -> bool:
        publisher.put(disarmed)  # again: the first may be sent before the station is found
        return bench.told("bearings are emulated again")

    wait_for(is_freed)
    wait_for(lambda: "camera" not in bench.station.parts.alarms.keyed())


def test_the_process_prints_how_well_the_camera_sees_once_nothing_is_wrong(
    bench: Bench, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    grey = camera().picture(PLACE, np.eye(3), np.zeros(3), np.zeros(3))
    write(files / "quick.avi", [grey] * 400, 20.0)
    view, ending, said = CameraView(), threading.Event(), [""]

    def source() -> OnboardCameraSource:
        video, lens, tags = (files / one for one in ("quick.avi", "camera.yaml", "beacons.toml"))
        return OnboardCameraSource(video, lens, tags, Notification(BEACONS), view)

    tracker = BearingsTracker(
        "a camera", source, {"quad1": "quad1"}, bench.page.session, views=[view]
    )
    thread = threading.Thread(target=tracker.run, args=(ending,), daemon=True)
    thread.start()

    def is_told() -> bool:
        said[0] += capsys.readouterr().out
        return "pixels from their places\n" in said[0]

    wait_for(is_told)
    ending.set()
    thread.join(20)
    [line] = [one for one in said[0].splitlines() if "their places" in one]
    assert re.fullmatch(r"tracker: quad1: \d+ pictures/s, .* 0\.\d\d pixels from .*", line)
