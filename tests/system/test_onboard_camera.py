"""`quadlab tracker onboard_camera`, started next to `quadlab up`: its bearings are flown."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from bearing_sim import BearingParameters
from extensions.vision.simulated.onboard_camera import OnboardCamera
from extensions.vision.simulated.parameters import CameraParameters
from quadrotor.records import beacon_ids_of
from tests.system.conftest import PATIENCE, Laboratory
from vehicle_link import clock
from vehicle_link.lockstep import page_at
from vehicle_link.topics.measurements import decode_bearings
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

pytestmark = pytest.mark.timeout(300)
PLACE = np.array([0.3, -0.2, 1.1])
TAGS = "size = 0.2\n[camera]\nposition = [0.05, 0, -0.03]\nturn = [0, -90, 0]\n"
RATE, SECONDS = 5.0, 40
AGE = 0.5
"""Age, in s, before which a bearing must arrive to be of use to the vehicle."""
ENOUGH = 10


@pytest.fixture
def video(tmp_path: Path) -> OnboardCamera:
    """Return a camera whose intrinsics, tags and video are in the folder."""
    parameters = BearingParameters(layout="wall", mount_pitch=-90.0)
    camera = OnboardCamera(parameters, CameraParameters(exposure=0.0))
    camera.lens.save(tmp_path / "camera.yaml")
    (tmp_path / "beacons.toml").write_text(TAGS)
    grey = camera.picture(PLACE, np.eye(3), np.zeros(3), np.zeros(3))
    colours, size = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), grey.shape[::-1]
    writer = cv2.VideoWriter(
        str(tmp_path / "hover.avi"), cv2.VideoWriter.fourcc(*"MJPG"), RATE, size
    )
    for _ in range(round(RATE * SECONDS)):
        writer.write(colours)
    writer.release()
    return camera


@pytest.fixture
def laboratory(lab: Laboratory) -> Iterator[Laboratory]:
    try:
        yield lab
    finally:
        clock.follow(None)


def test_its_bearings_reach_the_vehicle_in_time_while_simulated_time_waits_for_others(
    laboratory: Laboratory, video: OnboardCamera, tmp_path: Path, until: Callable[..., Any]
) -> None:
    laboratory.reach(mode="ready")
    page = page_at(laboratory.link_port)
    assert page is not None, "the simulation's clock is not found by its port"
    clock.follow(page)
    away = video.beacons.positions_w - PLACE
    true_b = away / np.linalg.norm(away, axis=1)[:, None]
    ages: list[float] = []

    def received(message: Received) -> None:
        frame = decode_bearings(message.payload)
        ids = beacon_ids_of(frame)
        if not ids:
            return
        seen_b = frame["bearing_b"][0, : len(ids)]
        if np.abs(seen_b - true_b[np.array(ids) - 1]).max() < 0.01:  # not an emulated one
            ages.append(1e-9 * (clock.time_ns() - int(frame["stamp_ns"][0])))

    session = loopback_session(laboratory.link_port)
    node = Node(session, "/quad1", "bearings_test")
    node.subscribe("bearings", TOPICS["bearings"].type_name, received)
    words = [sys.executable, "-m", "quadlab", "tracker", "onboard_camera", "--body", "quad1"]
    words += ["--video", str(tmp_path / "hover.avi")]
    words += ["--intrinsics", str(tmp_path / "camera.yaml")]
    words += ["--tags", str(tmp_path / "beacons.toml")]
    process = subprocess.Popen(
        [*words, "--loopback-port", str(laboratory.link_port)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        until(f"{ENOUGH} frames of bearings", lambda: len(ages) >= ENOUGH, 2 * PATIENCE)
    finally:
        process.terminate()
        said, _ = process.communicate(timeout=20)
        print(said)
        node.close()
        session.close()
    assert process.returncode == 0
    assert np.median(ages) < AGE, ages

    # The camera was ended on purpose, on the ground: its bearings are emulated again.
    line = "the camera on board was ended: bearings are emulated again"
    until("the event of its end", lambda: any(line in said for said in laboratory.lines))
    laboratory.ready()
