"""A rendered camera on board: bearings with their own stamps, correct while the vehicle moves."""

from __future__ import annotations

import numpy as np
import pytest

from bearing_sim import BearingParameters
from extensions.vision.simulated.onboard_camera import OnboardCamera
from extensions.vision.simulated.parameters import CameraParameters
from quadrotor.rotations import quaternion_from_matrix, rotation_exp
from vehicle_link.topics.measurements import JPEG

VELOCITY, TURNING = np.array([0.8, 0.5, -0.3]), np.array([0.3, -0.4, 0.5])
START, TICK_NS = np.array([0.0, 0.0, 1.0]), 10_000_000


@pytest.mark.parametrize(
    ("layout", "pitch"),
    [("wall", -90.0), ("ceiling", 180.0), ("1 .4 .3 0;2 -.4 .3 0;3 -.4 -.3 0;4 .4 -.3 0", 0.0)],
)
def test_bearings_of_a_moving_vehicle_are_those_of_its_pose_at_their_stamp(
    layout: str, pitch: float
) -> None:
    parameters = BearingParameters(
        layout=layout, mount_pitch=pitch, rate=20.0, delay=0.03, lost="2", stamp_error=0.001
    )
    camera = OnboardCamera(parameters, CameraParameters())
    frames = []
    for k in range(13):
        R_wb = rotation_exp(1e-9 * k * TICK_NS * TURNING)
        position_w = START + 1e-9 * k * TICK_NS * VELOCITY
        camera.observe(k * TICK_NS, position_w, quaternion_from_matrix(R_wb))
        frames += camera.due(k * TICK_NS)
    # The frame at 0.1 s has not arrived yet; before the second pose the motion is not known.
    assert [frame.stamp_ns for frame in frames] == [51_000_000]
    assert camera.next_ns == 130_000_000
    assert (camera.pictures, camera.unread) == (2, 0)
    seen, at = frames[0], 1e-9 * (frames[0].stamp_ns - 1_000_000)
    assert seen.beacon_ids.tolist() == [1, 3, 4]
    places = camera.beacons.positions_w[[0, 2, 3]]
    away = (places - START - at * VELOCITY) @ rotation_exp(at * TURNING)
    off = seen.bearings_b - away / np.linalg.norm(away, axis=1)[:, None]
    assert np.abs(off).max() < 1e-3
    assert seen.beacons == camera.beacons


@pytest.mark.parametrize(("rate", "taken"), [(0.0, 0), (5.0, 2), (30.0, 7)])
def test_the_log_gets_pictures_at_the_rate_that_is_set(rate: float, taken: int) -> None:
    bearings = BearingParameters(layout="wall", mount_pitch=-90.0, rate=20.0)
    camera = OnboardCamera(bearings, CameraParameters(pictures=rate))
    shown = []
    for k in range(37):
        camera.observe(k * TICK_NS, START, np.array([1.0, 0.0, 0.0, 0.0]))
        shown += camera.shown()
    assert len(shown) == taken
    assert all(jpeg.startswith(JPEG) for _, _, jpeg in shown)
    stamps = [stamp_ns for _, stamp_ns, _ in shown]
    assert stamps == sorted(set(stamps))


def test_nothing_in_view_is_a_frame_without_bearings() -> None:
    camera = OnboardCamera(BearingParameters(layout="ceiling", mount_pitch=0.0), CameraParameters())
    for k in range(5):
        camera.observe(k * TICK_NS, START, np.array([1.0, 0.0, 0.0, 0.0]))
    [frame] = camera.due(10 * TICK_NS)
    assert (len(frame.beacon_ids), camera.unread) == (0, 1)
