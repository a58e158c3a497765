"""Delay, axes and lever arm of a tracked body, from a known motion."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.parameters import TrackerCalibration
from extensions.identification.tracked_body.fit import Motion, identify_tracked_body
from quadrotor.errors import MeasurementError
from quadrotor.records import NO_ATTITUDE, has_attitude, pose_sample
from quadrotor.vehicle_model import GRAVITY
from tests.support.arrays import Array

LEVER = np.array([0.05, -0.03, 0.04])
MOUNT = Rotation.from_euler("ZYX", [100.0, 10.0, -20.0], degrees=True)


@cache
def motion(
    seed: int = 1, delay: float = 0.0, turning: float = 1.0, seconds: float = 30.0
) -> Motion:
    """Return a vehicle held at one place and turned about all axes, with simulated noise."""
    random = np.random.default_rng(seed)
    frequency, phase = random.uniform(0.1, 0.4, (2, 3)), random.uniform(0.0, 6.0, (2, 3))

    def attitude(at: Array) -> Rotation:
        angles = turning * np.sin(2.0 * np.pi * frequency * at[:, None, None] + phase).sum(axis=1)
        return Rotation.from_euler("ZYX", 0.4 * angles)

    time, seen = np.arange(0.0, seconds, 0.002), np.arange(0.5, seconds - 0.5, 0.01)
    rate = (attitude(time - 1e-4).inv() * attitude(time + 1e-4)).as_rotvec() / 2e-4
    rate += 0.004 + random.normal(0.0, 0.002, rate.shape)
    force = attitude(time).inv().apply([0.0, 0.0, GRAVITY]) + 0.1
    force += random.normal(0.0, 0.05, force.shape)
    noise = Rotation.from_rotvec(random.normal(0.0, math.radians(0.2), (len(seen), 3)))
    position = attitude(seen).apply(LEVER) + random.normal(0.0, 0.001, (len(seen), 3))
    quaternion = (attitude(seen) * MOUNT * noise).as_quat()[:, [3, 0, 1, 2]]
    return Motion(time, force, rate, seen + delay, position, quaternion)


@pytest.mark.parametrize(("seed", "delay"), [(1, 0.005), (2, 0.06), (3, -0.02)])
def test_delay_axes_and_lever_arm_are_found(seed: int, delay: float) -> None:
    found = identify_tracked_body(motion(seed, delay))
    assert found.delay == pytest.approx(delay, abs=1e-3)
    assert abs(found.drift) < 5.0 * found.drift_deviation
    away = Rotation.from_matrix(found.matrix_bt) * MOUNT.inv()
    assert math.degrees(away.magnitude()) < 0.2
    assert found.lever_b == pytest.approx(LEVER, abs=max(0.002, 4.0 * found.lever_deviation))
    assert found.lever_deviation < 0.003
    assert math.degrees(found.attitude_rms) == pytest.approx(0.2, rel=0.1)
    assert math.degrees(found.world_tilt) < 0.3


def test_a_clock_that_runs_is_told_as_drift() -> None:
    one = motion(1, 0.04)
    running = replace(one, pose_time=one.pose_time + 1e-4 * (one.pose_time - 15.0))
    found = identify_tracked_body(running)
    assert found.drift == pytest.approx(1e-4, abs=3e-5)
    assert found.delay == pytest.approx(0.04, abs=1e-3)


def test_poses_that_jump_do_not_count() -> None:
    one = motion(2, 0.03)
    far = one.position_w.copy()
    far[::20] += 0.5
    found = identify_tracked_body(replace(one, position_w=far))
    assert found.lever_b == pytest.approx(LEVER, abs=max(0.003, 5.0 * found.lever_deviation))


def test_a_motion_that_tells_nothing_is_refused() -> None:
    one = motion()
    mirrored = one.quaternion_wt * np.array([1.0, 1.0, -1.0, 1.0])
    hanging = one.quaternion_wt[:, [1, 0, 3, 2]] * np.array([-1.0, 1.0, -1.0, 1.0])
    none = np.empty(0)
    for wrong, word in (
        (motion(turning=0.0), "hardly turns"),
        (motion(seconds=8.0), "in common"),
        (replace(one, pose_time=none, position_w=none, quaternion_wt=none), "no poses"),
        (replace(one, quaternion_wt=mirrored), "mirrored"),
        (replace(one, quaternion_wt=hanging), "z up"),
    ):
        with pytest.raises(MeasurementError, match=word):
            identify_tracked_body(wrong)


def test_what_was_found_takes_a_pose_back_to_the_vehicles() -> None:
    known = TrackerCalibration(
        delay=0.04, x=0.05, y=-0.03, z=0.04, roll=-20.0, pitch=10.0, yaw=100.0
    )
    position, attitude = np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.5, -0.5, 0.5])
    tracked = known.tracked(position, attitude)
    expected = Rotation.from_quat(attitude[[1, 2, 3, 0]])
    assert tracked[0] == pytest.approx(position + expected.apply(LEVER))
    turned = (expected * MOUNT).as_quat()[[3, 0, 1, 2]]
    assert abs(tracked[1] @ turned) == pytest.approx(1.0)
    sample = known.measured(pose_sample(1_000_000_000, *tracked))
    assert sample["stamp_ns"][0] == 960_000_000
    assert sample["position_w"][0] == pytest.approx(position)
    assert sample["quaternion_wb"][0] == pytest.approx(attitude)


def test_of_a_single_marker_the_delay_alone_is_taken_off() -> None:
    known = TrackerCalibration(delay=0.04, x=0.05)
    sample = known.measured(pose_sample(1_000_000_000, [1.0, 2.0, 3.0], NO_ATTITUDE))
    assert sample["stamp_ns"][0] == 960_000_000
    assert not has_attitude(sample["quaternion_wb"][0])
    assert sample["position_w"][0] == pytest.approx([1.0, 2.0, 3.0])
