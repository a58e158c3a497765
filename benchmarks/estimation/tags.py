"""Detection of tags in rendered pictures: tags read, corner errors, and time, with peers."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import cv2
import numpy as np

from benchmarks.harness import Report, Row, Size, Target, time_in_turns
from extensions.vision.simulated.camera_scene import CAMERA, LENS
from extensions.vision.simulated.rendered_camera import Pattern
from extensions.vision.tags.detector import Picture, TagDetector, dictionary_of
from extensions.vision.tags.tag_layout import ROUND
from quadrotor.records import Array
from quadrotor.rotations import rotation_exp

Detect = Callable[[Picture], list[tuple[int, Array]]]

NUMBER, SIZE = 3, 0.12
CORNERS = SIZE * ROUND
FACING = np.diag([1.0, -1.0, -1.0])
PEER = "pupil_apriltags"
LIMIT = 10.0
"""Limit of the time per picture, in ms."""


class Taken(NamedTuple):
    """A picture of one tag, and the true places of its corners (4, 2), pixels."""

    grey: Picture
    corners: Array


def _pictures(count: int) -> list[Taken]:
    """Return pictures of a tag at 2 to 4 m, at any rotation and tilted by up to 60 degrees."""
    random, ours = np.random.default_rng(5), TagDetector(LENS)
    picture = ours.picture(NUMBER)
    wide = SIZE * len(picture) / (len(picture) - 2)
    taken = []
    for _ in range(count):
        around, turn = random.uniform(-np.pi, np.pi, 2)
        axis = np.array([np.cos(around), np.sin(around), 0.0])
        tilt = random.uniform(0.0, np.radians(60.0))
        R_ct = FACING @ rotation_exp(np.array([0.0, 0.0, turn])) @ rotation_exp(tilt * axis)
        place = random.uniform(2.0, 4.0) * np.array([*random.uniform(-0.3, 0.3, 2), 1.0])
        grey = CAMERA.take([Pattern(picture, (wide, wide), place, R_ct)], random)
        taken.append(Taken(grey, CAMERA.project(CORNERS @ R_ct.T + place)))
    return taken


def _opencv(refined: int) -> Detect:
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = refined
    detector = cv2.aruco.ArucoDetector(dictionary_of("APRILTAG_36h11"), settings)

    def detect(grey: Picture) -> list[tuple[int, Array]]:
        found: Any = detector.detectMarkers(grey)
        corners, numbers, _ = found
        if numbers is None:
            return []
        places = [np.asarray(one, float).reshape(4, 2) for one in corners]
        return list(zip(np.ravel(numbers).tolist(), places, strict=True))

    return detect


def _apriltag() -> Detect:
    library: Any = importlib.import_module(PEER)
    detector = library.Detector(families="tag36h11", quad_decimate=1.0, nthreads=1)

    def detect(grey: Picture) -> list[tuple[int, Array]]:
        # Its corners begin at the lower left in the opposite order; pixel centres are at 0.5.
        return [(one.tag_id, one.corners[::-1] - 0.5) for one in detector.detect(grey)]

    return detect


def run(size: Size = Size.FULL) -> Report:
    """Detect the tags of the same pictures with each method."""
    methods: dict[str, Detect] = {
        "quadlab": TagDetector(LENS).detect,
        "OpenCV": _opencv(cv2.aruco.CORNER_REFINE_NONE),
        "OpenCV, subpixel corners": _opencv(cv2.aruco.CORNER_REFINE_SUBPIX),
    }
    notes = ["640 × 480, 56° wide; one tag of 12 cm at 2 to 4 m, tilted by up to 60°"]
    if importlib.util.find_spec(PEER) is None:
        notes.append(f"without the peer {PEER}; install it with `pip install pupil-apriltags`")
    else:
        methods["AprilTag 3 (pupil-apriltags)"] = _apriltag()
    taken = _pictures(size.of(120, 20, 3))
    report = Report("tags", "Detection of tags", notes)

    def read(detect: Detect) -> list[float]:
        """Return the squared errors of the corners, pixels, of each tag read."""
        squares = []
        for one in taken:
            for number, corners in detect(one.grey):
                if number == NUMBER:
                    # A peer may begin with another corner, so the best match counts.
                    turned = [np.roll(corners, k, axis=0) - one.corners for k in range(4)]
                    squares.append(min(float((d**2).sum(axis=1).mean()) for d in turned))
        return squares

    times = time_in_turns(
        {name: (partial(read, detect), 1) for name, detect in methods.items()},
        rounds=size.of(7, 3, 1),
    )
    for name, detect in methods.items():
        squares = read(detect)
        report.rows.append(
            Row(
                name,
                {
                    "tags read": len(squares) / len(taken),
                    "corners, pixels rms": float(np.sqrt(np.mean(squares))),
                    "worst, pixels rms": float(np.sqrt(np.max(squares))),
                    "ms a picture": 1e3 * times[name].median / len(taken),
                    "times OpenCV": times[name].over(times["OpenCV"]),
                },
            )
        )
    ours = 1e3 * times["quadlab"].median / len(taken)
    report.targets.append(Target("one tag, ms a picture", ours, LIMIT))
    return report
