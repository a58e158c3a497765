"""The figures that any flight's verdict checks, in logs of made-up motions."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.evaluation.flight_checks import LIMITS, flight_checks, with_checks
from console.experiments.client import Result
from flight_log import LogWriter
from quadrotor.records import STATE
from vehicle_link.messages import encode, header, new
from vehicle_link.messages.cdr_layout import payloads_of
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import odometry_messages

MS, RATE = 1_000_000, 100


def write(
    path: Path,
    speed: float,
    *,
    tilt: float = 0.0,
    modes: tuple[str, ...] = ("armed",),
    in_the_air: bool = True,
    poses: tuple[list[float], list[float]] = ([], []),
) -> Path:
    """Write a flight that climbs to 1 m, tilts (rad, about x), and comes down at `speed` (m/s).

    Args:
        poses: x (m) and the quaternion's x of the tracker's poses, at 100 Hz.
    """
    climb = np.concatenate([np.full(RATE, 1.0), np.zeros(RATE)])
    down = np.full(round(RATE / speed), -speed)
    velocity = np.concatenate([np.zeros(20), climb, down, np.zeros(RATE)])
    states = np.zeros(len(velocity), STATE)
    stamps = 10 * MS * np.arange(1, len(velocity) + 1)
    angle = np.where((np.arange(len(velocity)) > 150) & (velocity == 0.0), tilt, 0.0)
    angle[-RATE:] = 0.0
    states["position_w"][:, 2] = np.cumsum(velocity) / RATE
    states["velocity_w"][:, 2] = velocity
    states["quaternion_wb"][:, 0], states["quaternion_wb"][:, 1] = (
        np.cos(angle / 2),
        np.sin(angle / 2),
    )
    with LogWriter(path, {"vehicle": "quad1"}, {}) as log:
        for payload, ns in zip(
            payloads_of(odometry_messages(stamps, states)), stamps.tolist(), strict=True
        ):
            log.write("/quad1/truth", TOPICS["truth"].type_name, payload, ns, ns)
        for k, (position, attitude) in enumerate(zip(*poses, strict=True), 1):
            name, ns = TOPICS["tracker_pose"].type_name, 10 * k * MS
            pose: Any = new(name, header=header(ns))
            pose.pose.position.x, pose.pose.orientation.x = position, attitude
            log.write("/quad1/tracker_pose", name, encode(pose), ns, ns)
        told = [(k * MS, mode, in_the_air) for k, mode in enumerate(modes, 1)]
        told += [(int(ns), modes[-1], in_the_air) for ns in stamps[10:-RATE:10]]
        told.append((int(stamps[-RATE]), modes[-1], False))
        for ns, mode, airborne in told:
            message = new(
                "quadlab_msgs/VehicleStatus", header=header(ns), mode=mode, airborne=airborne
            )
            log.write("/quad1/status", TOPICS["status"].type_name, encode(message), ns, ns)
    return path


@pytest.mark.parametrize("speed", [0.5, 2.0, 4.0])
def test_the_speed_of_the_touch_down_is_found(tmp_path: Path, speed: float) -> None:
    figures = flight_checks(write(tmp_path / "run.mcap", speed))
    assert figures["impact_m_s"] == pytest.approx(speed, abs=1e-6)
    verdict = with_checks(Result("passed", {}, {"rms": 1.0}), figures).verdict
    assert verdict == ("passed" if speed < 1.0 else "failed")


def test_the_largest_tilt_is_found(tmp_path: Path) -> None:
    figures = flight_checks(write(tmp_path / "run.mcap", 0.5, tilt=math.radians(80.0)))
    assert figures["tilt_max_deg"] == pytest.approx(80.0, abs=0.01)
    assert with_checks(Result("not_judged", {}), figures).verdict == "failed"


def test_emergencies_are_counted_once_each(tmp_path: Path) -> None:
    modes = ("armed", "emergency_land", "emergency_land", "ready", "armed", "cut")
    figures = flight_checks(write(tmp_path / "run.mcap", 0.5, modes=modes))
    assert figures["emergencies"] == 2.0


def test_what_is_done_by_hand_is_not_judged(tmp_path: Path) -> None:
    log = write(tmp_path / "run.mcap", 4.0, tilt=math.radians(80.0), in_the_air=False)
    assert flight_checks(log) == {}


def test_a_log_without_a_flight_changes_no_verdict(tmp_path: Path) -> None:
    LogWriter(tmp_path / "run.mcap", {}, {}).close()
    result = Result("passed", {"rms": 0.5}, {"rms": 1.0}, "")
    assert with_checks(result, flight_checks(tmp_path / "run.mcap")) == result


def test_the_figures_follow_those_of_the_experiment_which_count() -> None:
    result = Result("passed", {"rms": 0.5, "emergencies": 0.0}, {"rms": 1.0, "emergencies": 0.0})
    checked = with_checks(result, {"impact_m_s": 0.3, "emergencies": 0.0})
    assert list(checked.metrics) == ["rms", "emergencies", "impact_m_s"]
    assert checked.limits == {"rms": 1.0, "emergencies": 0.0, "impact_m_s": LIMITS["impact_m_s"]}
    assert checked.verdict == "passed"


@pytest.mark.parametrize(
    ("frozen", "attitude_too", "seconds"),
    [(5, True, 0.0), (20, True, 0.2), (20, False, 0.0), (80, False, 0.8)],
)
def test_poses_that_repeat_in_the_air_are_found_and_fail_the_flight(
    tmp_path: Path, frozen: int, attitude_too: bool, seconds: float
) -> None:
    moving = [0.001 * k for k in range(300)]
    held = [0.1 if 100 <= k <= 100 + frozen else x for k, x in enumerate(moving)]
    attitudes = held if attitude_too else moving
    figures = flight_checks(write(tmp_path / "run.mcap", 0.5, poses=(held, attitudes)))
    assert figures.get("tracker_frozen_s", 0.0) == pytest.approx(seconds, abs=1e-6)
    verdict = with_checks(Result("passed", {}, {}), figures).verdict
    assert verdict == ("failed" if seconds else "passed")
