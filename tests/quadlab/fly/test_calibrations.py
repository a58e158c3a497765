"""Gyroscope, accelerometer and motor bench in simulated time: values found, bad input refused."""

from __future__ import annotations

import contextlib
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.evaluation.accelerometer import Held, InForce, identify
from console.evaluation.motor_bench import Battery, from_log
from console.experiments.motor_bench import MotorBench
from estimation.calibration.motor_bench import BenchSchedule
from flight_log import read_log
from quadlab.__main__ import main
from quadrotor.errors import DegenerateGeometryError, LogFormatError, MeasurementError
from vehicle.simulator.parameters import SimulatorParameters

TRUTH = {
    "accelerometer_xx": 1.03,
    "accelerometer_xy": 0.02,
    "accelerometer_yz": -0.015,
    "accelerometer_zx": 0.01,
    "accelerometer_zz": 0.97,
    "accelerometer_bias_x": 0.3,
    "accelerometer_bias_y": -0.2,
    "accelerometer_bias_z": 0.25,
}
SKEWED = [f"simulator.{name}={value}" for name, value in TRUTH.items()]
IN_FORCE = [
    "imu.accelerometer_xx=0.98",
    "imu.accelerometer_zy=0.03",
    "imu.accelerometer_bias_y=0.2",
]
"""Earlier calibration, with which the samples of the log were made."""
QUICK = ["experiment.hold=1.5", "experiment.rest=0.5", "experiment.step=30"]
SCHEDULE = BenchSchedule(30, 190, 30, 1.5, 0.5)
NOISE = math.radians(0.2)


def fly(out: Path, experiment: str, *settings: str) -> dict[str, Any]:
    printed = io.StringIO()
    words = ["fly", experiment, "--json", "--out", str(out)]
    with contextlib.redirect_stdout(printed):
        main([*words, *(word for one in settings for word in ("--set", one))])
    report: dict[str, Any] = json.loads(printed.getvalue().strip().splitlines()[-1])
    return report


@pytest.fixture(scope="module")
def faces(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    words = *SKEWED, *IN_FORCE, "experiment.method=faces", "experiment.hold=0.5"
    return fly(tmp_path_factory.mktemp("faces"), "accelerometer", *words)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return fly(tmp_path_factory.mktemp("bench"), "motor_bench", *QUICK)


def errors(proposal: dict[str, Any]) -> tuple[float, float]:
    """Return the largest errors of T and of b (m/s²) against the truth."""
    truth = SimulatorParameters.model_validate(TRUTH)
    missed = {
        name: abs(value - getattr(truth, name.removeprefix("imu.")))
        for name, value in proposal["values"].items()
    }
    bias = max(error for name, error in missed.items() if "bias" in name)
    return max(error for name, error in missed.items() if "bias" not in name), bias


def test_the_gyroscope_s_drift_is_found(tmp_path: Path) -> None:
    report = fly(tmp_path, "gyroscope")
    proposal = report["proposal"]
    assert report["verdict"] == "passed"
    assert report["metrics"]["standard_error_deg_s"] < 0.03
    assert proposal["values"] == {}
    found = [one["value"] for one in proposal["figures"]]
    assert found == pytest.approx([0.9, -0.7, 0.5], abs=0.03)
    assert {one["name"] for one in proposal["quality"]} > {"standard error", "drift left"}


def test_the_drift_left_may_be_four_times_its_error(tmp_path: Path) -> None:
    report = fly(tmp_path, "gyroscope", "experiment.samples=200")
    quality = {one["name"]: one for one in report["proposal"]["quality"]}
    assert quality["standard error"]["value"] == pytest.approx(0.0245, rel=0.1)
    assert quality["drift left"]["limit"] == pytest.approx(4.0 * 0.0255, rel=0.1)


def test_twelve_poses_with_the_tracker_give_matrix_and_bias(tmp_path: Path) -> None:
    words = *SKEWED, "experiment.hold=0.5", "tracker.attitude_noise=0.2"
    report = fly(tmp_path, "accelerometer", *words)
    assert report["verdict"] == "passed"
    assert report["metrics"]["poses"] == 12
    matrix, bias = errors(report["proposal"])
    assert matrix < 0.005
    assert bias < 0.06
    assert len(report["proposal"]["residuals"]) == 12


def test_six_faces_give_them_whatever_calibration_was_in_force(faces: dict[str, Any]) -> None:
    matrix, bias = errors(faces["proposal"])
    assert matrix < 0.002
    assert bias < 0.02
    assert faces["metrics"]["condition_number"] == pytest.approx(5.9, abs=0.2)
    assert faces["proposal"]["present"]["imu.accelerometer_xx"] == 0.98, "nothing was changed"
    assert faces["proposal"]["good"]


PLAIN = InForce(np.eye(3), np.zeros(3))


@pytest.fixture(scope="module")
def held(faces: dict[str, Any]) -> list[Held]:
    """Return the six poses by the reported times of turning, each still for half a second."""
    from console.evaluation.log_columns import read_columns

    paths = tuple(f"angular_velocity.{axis}" for axis in "xyz")
    imu = read_columns(Path(faces["log"]), "quad1", {"imu": paths})["imu"]
    rates = np.linalg.norm(np.stack([imu.values(path) for path in paths]), axis=0)
    moving = np.flatnonzero(rates > math.radians(20.0))
    ends = [moving[0], *moving[1:][np.diff(moving) > 100]]
    names = ("upright", "upside down", "nose up", "nose down", "left side up", "right side up")
    return [
        Held(imu.time[end] - 0.45, imu.time[end] - 0.05, name)
        for end, name in zip(ends, names, strict=True)
    ]


def test_too_few_or_coplanar_poses_are_refused_with_the_next_one(
    faces: dict[str, Any], held: list[Held]
) -> None:
    log = Path(faces["log"])
    with pytest.raises(MeasurementError, match=r"3 poses, needed are 4 .*next: "):
        identify(log, "quad1", PLAIN, held[:3], NOISE)
    flat = [held[k] for k in (0, 1, 2, 3)]
    with pytest.raises(DegenerateGeometryError, match=r"rank 3 of 4.*next: (left|right) side up"):
        identify(log, "quad1", PLAIN, flat, NOISE)


def test_a_vehicle_that_moved_or_ran_its_motors_in_a_pose_is_refused(
    faces: dict[str, Any], held: list[Held], bench: dict[str, Any]
) -> None:
    moved = [*held[:3], Held(held[3].start - 1.0, held[3].end, "nose down")]
    with pytest.raises(MeasurementError, match=r"the vehicle moved in pose 4: [\d.]+ m/s²"):
        identify(Path(faces["log"]), "quad1", PLAIN, moved, NOISE)
    with pytest.raises(MeasurementError, match="motors were on in pose 1"):
        identify(Path(bench["log"]), "quad1", PLAIN, [Held(3.0, 4.0, "upright")], NOISE)
    with pytest.raises(MeasurementError, match="pose 1 has 0 samples in the log"):
        identify(Path(bench["log"]), "quad1", PLAIN, [Held(300.0, 301.0, "upright")], NOISE)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["simulator.accelerometer_zz=0.5"], "(the accelerometer is saturated at 19."),
        (["simulator.gyroscope_noise=5", "safety.gyro_deviation_max=10"], "it turns at"),
    ],
)
def test_a_saturated_or_shaken_vehicle_never_holds_a_pose(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    with pytest.raises(IndexError):  # no report
        fly(tmp_path, "accelerometer", "experiment.patience=5", *words)
    assert told in capsys.readouterr().err


# ---------------------------------------------------------------- motor bench
def test_the_motor_s_law_ratio_and_lag_are_found(bench: dict[str, Any]) -> None:
    found, truth = bench["proposal"]["values"], SimulatorParameters()
    assert bench["verdict"] == "passed"
    forces = np.linspace(0.32, 6.0, 30)
    law = np.sqrt(forces) / found["model.motor_slope"] - found["model.motor_offset"]
    assert np.abs(law - (np.sqrt(forces) / truth.motor_slope - truth.motor_offset)).max() < 0.4
    assert found["model.torque_ratio"] == pytest.approx(truth.torque_ratio, rel=0.005)
    assert found["model.motor_time_constant"] == pytest.approx(0.047, rel=0.01)
    assert (found["model.motor_reference_min"], found["model.motor_reference_max"]) == (30, 180)
    assert bench["metrics"]["dead_time_s"] == pytest.approx(0.001, abs=0.0005)
    assert bench["metrics"]["quadratic_worst_count"] > 20 * bench["metrics"]["root_law_worst_count"]
    names = [name for name, _ in bench["proposal"]["residuals"]]
    assert names[0] == "step 30, count"
    assert names[6] == "quadratic 30, count"


def test_the_bench_is_logged_and_told(bench: dict[str, Any]) -> None:
    readings = sum(1 for _ in read_log(Path(bench["log"]), {"/quad1/bench_reading"}))
    assert readings == pytest.approx(200 * SCHEDULE.duration, rel=0.05)


def test_an_unplugged_sensor_stops_the_motor_within_a_second(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(IndexError):
        fly(tmp_path, "motor_bench", *QUICK, "simulator.bench_sensor=none")
    assert "the force/torque sensor sends nothing for 1 s" in capsys.readouterr().err
    log = tmp_path / "motor_bench_seed1.mcap"
    stamps = [m.log_ns for m in read_log(log, {"/quad1/imu"})]
    assert (stamps[-1] - stamps[0]) * 1e-9 < 5.0


def test_a_bench_s_log_without_readings_is_refused(faces: dict[str, Any]) -> None:
    log = Path(faces["log"])
    with pytest.raises(LogFormatError, match=r"no messages of bench_reading of quad1"):
        from_log(log, "quad1", 1, SCHEDULE, 1.0, Battery())


def test_a_bench_that_ended_early_names_the_step(bench: dict[str, Any]) -> None:
    with pytest.raises(MeasurementError, match=r"step 120 has \d+ force samples"):
        from_log(Path(bench["log"]), "quad1", 1, SCHEDULE, 6.0, Battery())


def test_a_battery_that_is_followed_gives_the_law_of_its_nominal_voltage(
    bench: dict[str, Any],
) -> None:
    followed = from_log(Path(bench["log"]), "quad1", 1, SCHEDULE, 1.002, Battery(15.2, 1.0))
    plain = bench["proposal"]["values"]["model.motor_slope"]
    assert followed.voltage == pytest.approx(16.7, abs=0.2)
    assert followed.slope == pytest.approx(plain * 15.2 / followed.voltage, rel=1e-3)


def test_too_few_references_for_a_law_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "--set", "experiment.first=30", "--set", "experiment.last=60"
    assert main(["fly", "motor_bench", "--out", str(tmp_path), *words]) == 2
    assert "are 4 references, a law needs 5" in capsys.readouterr().err
    assert not list(tmp_path.iterdir()), "nothing was begun"
    assert MotorBench().planned == pytest.approx(3.0 + 17 * 15.0)
