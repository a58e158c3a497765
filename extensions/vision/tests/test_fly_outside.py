"""Rendered cameras around the room: fused poses of a moving vehicle, also when one is covered."""

from __future__ import annotations

import numpy as np

from extensions.vision.simulated.outside_cameras import OutsideCameras
from extensions.vision.simulated.parameters import OutsideCameraParameters
from quadrotor.rotations import quaternion_from_matrix, rotation_exp
from vehicle_link.topics.measurements import JPEG

TICK_NS = 10_000_000
VELOCITY, TURNING = np.array([0.8, 0.5, -0.3]), np.array([0.3, -0.4, 0.5])
START = np.array([0.0, 0.0, 1.0])


def flown(cameras: OutsideCameras, ticks: int) -> dict[int, float]:
    """Return how far each pose is off, m, by its stamp."""
    off = {}
    for k in range(ticks):
        t = 1e-9 * k * TICK_NS
        R_wb = rotation_exp(t * TURNING)
        cameras.observe(k * TICK_NS, START + t * VELOCITY, quaternion_from_matrix(R_wb))
        for pose in cameras.due(k * TICK_NS):
            place = START + 1e-9 * pose.stamp_ns * VELOCITY
            off[pose.stamp_ns] = float(np.linalg.norm(pose.position_w - place))
    return off


def test_two_cameras_in_turn_give_poses_at_twice_their_rate_and_go_on_when_one_is_covered() -> None:
    parameters = OutsideCameraParameters(
        number=2, rate=20.0, delay=0.02, covered=2, covered_from=0.25, pictures=5.0
    )
    cameras = OutsideCameras(parameters, 1)
    off = flown(cameras, 43)
    stamps = np.array(sorted(off)) / 25_000_000
    np.testing.assert_allclose(stamps, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16][: len(off)])
    assert len(off) == 13
    assert max(off.values()) < 0.015
    (said,) = cameras.said()
    assert said.startswith("camera 1: the picture is black")
    shown = cameras.shown()
    assert {topic for topic, _, _ in shown} == {"tracker_picture", "tracker_2_picture"}
    assert all(jpeg.startswith(JPEG) for _, _, jpeg in shown)


def test_a_camera_with_a_wrong_place_is_told() -> None:
    parameters = OutsideCameraParameters(number=2, rate=30.0, misplaced=0.06, pictures=0.0)
    cameras = OutsideCameras(parameters, 2)
    flown(cameras, 45)
    assert any("cameras 0 and 1 see quad1 6 cm apart" in line for line in cameras.said())
