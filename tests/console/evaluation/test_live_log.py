"""Judgement of a station's run: sources with different stamps, actions of the vehicle itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.evaluation.bearings import read_flight
from console.evaluation.tracking import tracking_errors
from console.experiments.bearings import BearingsExperiment
from flight_log import LogWriter
from quadrotor.records import POSE_SAMPLE, STATE, TICK
from vehicle_link.messages import encode, header, new
from vehicle_link.messages.cdr_layout import payloads_of
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import encode_change
from vehicle_link.topics.measurements import encode_bearings, pose_messages, position_messages
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import odometry_messages, reference_messages, state_messages

MS = 1_000_000
OFF = 0.01  # m, between truth and reference, and between truth and estimate
SIGN_FLIPS_AT = 2000


def path_w(t: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(t), np.cos(t), 1.0 + 0.1 * np.sin(2 * t)], axis=1)


def write(
    path: Path,
    truth: str,
    *,
    sigma: float = 1.5,
    layout: str = "paper",
    seen: bool = True,
    cut: bool = False,
    outliers: int = 0,
) -> Path:
    """Write 10 s on bearings; truth at 100 Hz, 0.4 ms off the ticks at 500 Hz.

    Args:
        sigma: deviation of the bearings, deg.
        layout: the beacons as the vehicle has them.
        seen: whether the log has bearings.
        outliers: every so many poses of the tracker, one is 2 m off; 0 for none.
    """
    stamps = np.arange(0, 10_000, 2) * MS
    ticks = np.zeros(len(stamps), TICK)
    ticks["imu"]["stamp_ns"] = stamps
    ticks["state"]["quaternion_wb"][:, 0] = 1.0
    ticks["state"]["quaternion_wb"][SIGN_FLIPS_AT:, 0] = -1.0  # the same attitude
    ticks["state"]["position_w"] = np.add(path_w(stamps * 1e-9), (OFF, 0, 0))
    ticks["reference"]["position_w"] = np.add(path_w(stamps * 1e-9), (0, OFF, 0))
    true_ns = np.arange(10, 9_990, 10) * MS + 400_000
    states = np.zeros(len(true_ns), STATE)
    states["quaternion_wb"][:, 0] = 1.0
    states["position_w"] = path_w(true_ns * 1e-9)
    poses = np.zeros(len(true_ns), POSE_SAMPLE)
    poses["stamp_ns"] = true_ns
    poses["position_w"], poses["quaternion_wb"] = states["position_w"], states["quaternion_wb"]
    if outliers:
        poses["position_w"][::outliers, 0] += 2.0
    true = {
        "truth": lambda: payloads_of(odometry_messages(true_ns, states)),
        "tracker_pose": lambda: payloads_of(pose_messages(poses)),
        "tracker_position": lambda: payloads_of(position_messages(poses)),
    }[truth]()
    messages: list[tuple[str, bytes, int]] = [
        *(
            ("state", p, ns)
            for p, ns in zip(payloads_of(state_messages(ticks)), stamps.tolist(), strict=True)
        ),
        *(
            ("reference", p, s)
            for p, s in zip(payloads_of(reference_messages(ticks)), stamps.tolist(), strict=True)
        ),
        *((truth, p, ns) for p, ns in zip(true, true_ns.tolist(), strict=True)),
    ]

    def change(name: str, old: str, value: str, ms: int) -> None:
        payload = encode_change(ParameterChange(ms * MS, name, old, value, "ada", 1))
        messages.append(("parameter_changes", payload, ms * MS))

    def status(mode: str, ms: int) -> None:
        message = new("quadlab_msgs/VehicleStatus", header=header(ms * MS), mode=mode)
        messages.append(("status", encode(message), ms * MS))

    change("estimation.source", "poses", "bearings", 500)
    change("estimation.source", "bearings", "poses", 9_500)
    ids, ahead = (1, 2, 3, 4), ((1.0, 0.0, 0.0),) * 4
    for ms in range(0, 10_000, 33) if seen else ():
        payload = encode_bearings(ms * MS, ids, ahead, np.radians(sigma), "quad1")
        messages.append(("bearings", payload, ms * MS))
    status("armed", 100)
    status("cut" if cut else "armed", 9_000)
    values = {"vehicle": {"model.mass": 1.3, "beacons.layout": layout}, "station": {}}
    attachments = {"parameters.json": json.dumps(values).encode()}
    with LogWriter(path, {"vehicle": "quad1"}, attachments) as log:
        for topic, payload, ns in sorted(messages, key=lambda m: m[2]):
            log.write(f"/quad1/{topic}", TOPICS[topic].type_name, payload, int(ns), int(ns))
    return path


def test_stamps_that_never_meet_are_judged_between_neighbours(tmp_path: Path) -> None:
    flight = read_flight(write(tmp_path / "run.mcap", "truth"), "quad1", 1.0)
    metrics = flight.metrics()
    assert metrics["samples"] > 700
    assert metrics["position_rms_m"] == pytest.approx(OFF, abs=1e-5)
    assert metrics["estimate_position_rms_m"] == pytest.approx(OFF, abs=1e-5)
    assert metrics["estimate_attitude_rms_deg"] == pytest.approx(0.0, abs=1e-6)
    assert metrics["emergencies"] == 0.0
    errors = tracking_errors(tmp_path / "run.mcap", "quad1", 1.0, 9.0).metrics()
    assert errors["position_rms_m"] == pytest.approx(OFF, abs=1e-5)


def test_without_truth_the_trackers_poses_count_and_give_no_velocity(tmp_path: Path) -> None:
    flight = read_flight(write(tmp_path / "run.mcap", "tracker_pose"), "quad1", 1.0)
    metrics = flight.metrics()
    assert metrics["position_rms_m"] == pytest.approx(OFF, abs=1e-5)
    assert "estimate_velocity_rms_m_s" not in metrics
    errors = tracking_errors(tmp_path / "run.mcap", "quad1", 1.0, 9.0).metrics()
    assert errors["position_rms_m"] == pytest.approx(OFF, abs=1e-5)


@pytest.mark.parametrize(("outliers", "left_out"), [(0, 0.0), (20, 0.05), (2, 0.0)])
def test_poses_that_the_estimator_refuses_are_not_the_vehicles_errors(
    tmp_path: Path, outliers: int, left_out: float
) -> None:
    log = write(tmp_path / "run.mcap", "tracker_pose", outliers=outliers)
    errors = tracking_errors(log, "quad1", 1.0, 9.0).metrics()
    assert errors["poses_left_out"] == pytest.approx(left_out, abs=0.002)
    # When half of them are off, it may be the estimate: they count.
    assert errors["position_max_m"] == pytest.approx(2.0 if outliers == 2 else OFF, abs=0.01)


def test_without_truth_the_positions_of_a_marker_count_and_give_no_yaw(tmp_path: Path) -> None:
    log = write(tmp_path / "run.mcap", "tracker_position")
    errors = tracking_errors(log, "quad1", 1.0, 9.0).metrics()
    assert errors["position_rms_m"] == pytest.approx(OFF, abs=1e-5)
    assert np.isnan(errors["yaw_rms_deg"])


def test_a_flight_that_was_cut_fails_however_well_it_flew(tmp_path: Path) -> None:
    well = BearingsExperiment().evaluate(write(tmp_path / "well.mcap", "truth"))
    cut = BearingsExperiment().evaluate(write(tmp_path / "cut.mcap", "truth", cut=True))
    assert (well.verdict, cut.verdict) == ("passed", "failed")
    assert (well.metrics["emergencies"], cut.metrics["emergencies"]) == (0.0, 1.0)


def test_another_sensor_has_limits_of_its_own_and_the_tracker_adds_its_noise(
    tmp_path: Path,
) -> None:
    plain, coarse, tracked = (
        BearingsExperiment().evaluate(write(tmp_path / f"{k}.mcap", truth, sigma=sigma))
        for k, (truth, sigma) in enumerate([("truth", 1.5), ("truth", 3.0), ("tracker_pose", 1.5)])
    )
    for name in ("position_rms_m", "estimate_position_rms_m", "estimate_attitude_rms_deg"):
        assert plain.limits[name] < coarse.limits[name]
        assert plain.limits[name] < tracked.limits[name]
    assert coarse.limits["estimate_position_rms_m"] < 3.0 * plain.limits["estimate_position_rms_m"]
    assert plain.verdict == coarse.verdict == tracked.verdict == "passed"


@pytest.mark.parametrize("other", [{"seen": False}, {"layout": "nowhere"}])
def test_a_log_that_does_not_tell_what_its_sensor_allows_is_not_judged(
    tmp_path: Path, other: dict[str, Any]
) -> None:
    result = BearingsExperiment().evaluate(write(tmp_path / "run.mcap", "truth", **other))
    assert result.verdict == "not_judged"
    assert "position_rms_m" not in result.limits
    assert result.limits["emergencies"] == 0.0
    cut = BearingsExperiment().evaluate(write(tmp_path / "cut.mcap", "truth", cut=True, **other))
    assert cut.verdict == "failed"
