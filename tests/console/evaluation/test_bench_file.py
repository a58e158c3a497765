"""A motor bench recorded elsewhere: the form of its file, and its results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from console.evaluation.bench_file import read_bench_file
from console.evaluation.motor_bench import from_file, record_of
from console.experiments.motor_bench import MotorBench
from quadrotor.errors import MeasurementError, StorageError

SLOPE, OFFSET, RATIO, LAG, DELAY = 0.0126403, 14.267, 0.0174, 0.047, 0.004
HEADER = "time_s,reference,force_N,torque_Nm,speed"


def recorded(rng: np.random.Generator, *, speed: bool = True) -> list[str]:
    """Return eight references held for 3 s after 1.5 s of rest, 200 Hz, as lines of a file."""
    time = np.arange(0.0, 8 * 4.5, 0.005)
    held = 30.0 + 20.0 * (time // 4.5)
    reference = np.where(time % 4.5 < 1.5, 25.0, held)
    course, value = [], 25.0
    late = np.interp(time - DELAY, time, np.arange(len(time))).round().astype(int)
    for wanted in reference[late]:
        value += (1.0 - np.exp(-0.005 / LAG)) * (wanted - value)
        course.append(value)
    turns = np.array(course)
    force = np.square(SLOPE * (turns + OFFSET)) + 0.01 * rng.standard_normal(len(time))
    table = [time, reference, force, RATIO * force]
    table += [37.0 * (turns + OFFSET)] if speed else []
    header = HEADER if speed else HEADER.removesuffix(",speed")
    return [header, *(",".join(f"{cell:.6f}" for cell in row) for row in np.array(table).T)]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture
def lines(rng: np.random.Generator) -> list[str]:
    return recorded(rng)


def written(folder: Path, lines: list[str]) -> Path:
    path = folder / "bench.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("speed", [True, False])
def test_a_recorded_bench_gives_the_motor(
    tmp_path: Path, rng: np.random.Generator, speed: bool
) -> None:
    record = record_of(
        from_file(read_bench_file(written(tmp_path, recorded(rng, speed=speed)))), {}
    )
    found = record.values
    assert found["model.motor_slope"] == pytest.approx(SLOPE, rel=0.005)
    assert found["model.motor_offset"] == pytest.approx(OFFSET, abs=0.3)
    assert found["model.torque_ratio"] == pytest.approx(RATIO, rel=0.005)
    assert found["model.motor_time_constant"] == pytest.approx(LAG, rel=0.01 if speed else 0.03)
    assert bool(record.warnings) is not speed
    assert found["model.motor_reference_max"] == 170.0


@pytest.mark.parametrize(
    ("place", "line", "said"),
    [
        (
            0,
            "time_s,reference,force_N,speed",
            "line 1: the column torque_Nm is missing; needed are",
        ),
        (0, "time,reference,force,torque,speed", "the column 'time' has no unit; convert it"),
        (2, "0.005,25,0.25,x,1", "line 3: torque_Nm = 'x' is not a number"),
        (2, "0.005,25,nan,0.1,1", "line 3: force_N = 'nan' is not a number"),
        (2, "0.005,25,0.1", "line 3: 3 values, the header has 5"),
        (3, "0.002,25,0.25,0.1,1", "line 4: time_s = 0.002 is not after 0.005"),
    ],
)
def test_a_bad_line_is_named(
    tmp_path: Path, lines: list[str], place: int, line: str, said: str
) -> None:
    lines[place] = line
    with pytest.raises(MeasurementError) as caught:
        read_bench_file(written(tmp_path, lines))
    assert said in str(caught.value)
    assert str(caught.value).startswith("bench.csv line ")


def test_a_short_a_missing_and_a_motionless_file_are_refused(
    tmp_path: Path, lines: list[str]
) -> None:
    with pytest.raises(MeasurementError, match=r"line 101: it ends after 100 samples, needed"):
        read_bench_file(written(tmp_path, lines[:101]))
    with pytest.raises(MeasurementError, match="4 steps between 30 and 180"):
        from_file(read_bench_file(written(tmp_path, lines[:3600])))
    experiment = MotorBench()
    experiment.parameters.csv = str(tmp_path / "absent.csv")
    with pytest.raises(StorageError, match=r"absent\.csv cannot be read: No such file"):
        experiment.check()


def test_a_file_of_quick_changes_has_no_step(tmp_path: Path) -> None:
    rows = [f"{0.005 * k},{30 + k % 100},1,0.1,1" for k in range(1000)]
    with pytest.raises(MeasurementError, match="no reference is held for longer than 1 s"):
        from_file(read_bench_file(written(tmp_path, [HEADER, *rows])))
