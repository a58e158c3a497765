"""Plots of reports show every peak, every gap, and the steps of a bench."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from console.plots import POINTS, broken, thinned
from console.reports.bench_steps import law_figures
from console.reports.run_log import read_run
from extensions.reports.tables import figure, number
from flight_log import LogWriter
from quadrotor.plain_rotations import rotation_vectors_between
from vehicle_link.messages import encode, new


def test_a_thinned_line_keeps_every_peak_and_every_hole() -> None:
    random = np.random.default_rng(3)
    time = np.arange(100_001) * 0.002
    values = random.normal(size=len(time))
    values[[4_321, 77_777]] = 50.0, -60.0
    values[60_000:60_010] = np.nan
    t, v = thinned(time, values)
    assert len(t) <= POINTS + 10
    assert (np.diff(t) > 0.0).all()
    assert {(time[4_321], 50.0), (time[77_777], -60.0)} <= set(zip(t, v, strict=True))
    hole = np.isnan(v)
    assert hole.any()
    assert ((t[hole] >= time[60_000]) & (t[hole] < time[60_010])).all()
    few = thinned(time[:50], values[:50])
    assert np.array_equal(few[1], values[:50])


def test_a_line_is_broken_over_a_silence_and_nowhere_else() -> None:
    time = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(2.0, 3.0, 0.01)])
    _, values = broken(time, np.ones(200))
    assert np.flatnonzero(np.isnan(values)).tolist() == [100]
    assert len(broken(time[:100], np.ones(100))[1]) == 100


def test_the_rotation_between_attitudes_is_the_turn_from_the_estimate_to_the_truth() -> None:
    half = 0.5 * 0.02
    estimated = np.array([[1.0, 0.0, 0.0, 0.0], [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    turn = np.array([np.cos(half), np.sin(half), 0.0, 0.0])  # about world x
    w, x = turn[0], turn[1]
    true = np.stack(
        [
            [w * q[0] - x * q[1], w * q[1] + x * q[0], w * q[2] - x * q[3], w * q[3] + x * q[2]]
            for q in estimated
        ]
    )
    for sign in (1.0, -1.0):
        found = rotation_vectors_between(estimated, sign * true)
        assert found == pytest.approx(np.array([[0.02, 0.0, 0.0]] * 2), abs=1e-9)


def test_the_law_of_a_bench_is_found_from_its_log_alone(tmp_path: Path) -> None:
    slope, offset, ratio = 0.0126, 14.0, 0.0170
    writer = LogWriter(tmp_path / "bench.mcap", {"vehicle": "quad1"}, {})
    actuators, reading = "quadlab_msgs/Actuators", "quadlab_msgs/BenchReading"
    stamp = 0
    for reference in [r for step in range(30, 200, 20) for r in (25, step)]:
        thrust = (slope * (reference + offset)) ** 2
        told = encode(new(actuators, motor_references=np.array([0.0, reference, 0.0, 0.0])))
        felt = encode(new(reading, force=thrust, torque=-ratio * thrust, speed=np.nan))
        for _ in range(50):
            stamp += 40_000_000
            writer.write("/quad1/actuators", actuators, told, stamp, stamp)
            writer.write("/quad1/bench_reading", reading, felt, stamp, stamp)
    writer.close()
    law = law_figures(read_run(tmp_path / "bench.mcap"))
    assert law["torque_ratio_m"] == pytest.approx(ratio, rel=1e-5)
    assert law["thrust_min_N"] == pytest.approx((slope * (30 + offset)) ** 2, rel=1e-4)
    assert law["thrust_max_N"] == pytest.approx((slope * (180 + offset)) ** 2, rel=1e-4)
    assert law["root_law_worst_count"] < 0.01 < law["quadratic_worst_count"]


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("position_rms_m", 0.00235, ("position rms", "2.35 mm")),
        ("torque_rms_min_n_m", 0.0285, ("torque rms min", "28.5 mN m")),
        ("estimate_velocity_rms_m_s", 0.013, ("estimate velocity rms", "13 mm/s")),
        ("drift_left_deg_s", 0.0152, ("drift left", "0.0152°/s")),
        ("inertia_xx_kg_m2", 0.0154, ("inertia xx", "0.0154 kg m²")),
        ("erratic_std_kg", 0.0002, ("erratic std", "0.2 g")),
        ("mass_kg", 1.3081, ("mass", "1.308 kg")),
        ("saturated_share", 0.015, ("saturated", "1.5 %")),
        ("samples", 2200.0, ("samples", "2200")),
    ],
)
def test_figures_are_told_with_their_units(name: str, value: float, shown: tuple[str, str]) -> None:
    assert figure(name, value) == shown
    assert number(float("nan")) == "–"
