"""Experiment `vibration`: densities, lines and walks from known noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from console.evaluation.log_columns import FlownParameters
from console.evaluation.spectrum import evenly, rotor_frequency, spectrum
from extensions.identification.vibration.evaluation import (
    Vibration,
    estimate_vibration,
    read_vibration,
)
from extensions.identification.vibration.lines import lines_of
from flight_log import LogWriter
from quadrotor.constants import THRUST_PER_TURN
from quadrotor.errors import LogFormatError, MeasurementError
from quadrotor.vehicle_model import GRAVITY
from tests.support.arrays import Array

FREQUENCY, SECONDS = 500.0, 20.0
DENSITY = np.array([0.012] * 3 + [np.radians(0.03)] * 3)
ROTORS = np.array([70.0, 78.0, 86.0, 95.0])
PARAMETERS = FlownParameters({}, {})


def noise(seed: int, density: Array, seconds: float = SECONDS) -> tuple[Array, Array]:
    """Return white noise of a density (6,), with one in five hundred samples lost."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / FREQUENCY)
    values = density * np.sqrt(FREQUENCY) * random.standard_normal((len(time), 6))
    values[:, 2] += GRAVITY
    kept = random.random(len(time)) > 0.002
    return time[kept], values[kept]


def estimated(rest: tuple[Array, Array], hover: tuple[Array, Array]) -> Vibration:
    return estimate_vibration(rest, hover, ROTORS, PARAMETERS)


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_proposed_is_the_true_one_within_what_it_is_uncertain_by(seed: int) -> None:
    time, values = noise(seed, DENSITY)
    values += (0.5 * np.sin(2 * np.pi * 86.3 * time))[:, None] * (DENSITY / DENSITY[0])
    found = estimated(noise(seed + 100, 0.2 * DENSITY), (time, values))
    record = found.record()
    assert record.good
    assert record.values == {
        "estimation.error_state.accelerometer_noise": pytest.approx(0.012, rel=0.03),
        "estimation.error_state.gyroscope_noise": pytest.approx(0.03, rel=0.03),
        "estimation.rate_notch": 86.0,
    }
    for one, density in zip(found.sensors.values(), (0.012, 0.03), strict=True):
        assert one.noise == pytest.approx(density, rel=3.0 * max(one.uncertain, 0.005))
        assert one.rest == pytest.approx(0.2 * density, rel=0.25)
        assert not one.walks
        strongest = one.lines[0]
        assert strongest.frequency == pytest.approx(86.3, abs=0.5)
        assert strongest.rms == pytest.approx(0.5 / np.sqrt(2.0) * density / 0.012, rel=0.05)
        assert strongest.source == "rotor rear"


def test_a_bias_that_walks_is_seen_at_rest_and_proposed() -> None:
    time, values = noise(7, 0.2 * DENSITY, 60.0)
    random = np.random.default_rng(8)
    walk = np.radians(0.02) * np.sqrt(1.0 / FREQUENCY)
    values[:, 3:] += np.cumsum(walk * random.standard_normal((len(time), 3)), axis=0)
    record = estimated((time, values), noise(9, DENSITY)).record()
    assert record.values["estimation.error_state.gyroscope_bias_walk"] == pytest.approx(
        0.02, rel=0.5
    )
    assert "estimation.error_state.accelerometer_bias_walk" not in record.values


def test_a_line_is_named_after_rotor_or_blades_and_else_unknown() -> None:
    time = np.arange(0.0, 10.0, 1.0 / FREQUENCY)
    random = np.random.default_rng(3)
    lines = {70.5: "rotor front", 190.0: "blades right", 45.0: "unknown"}
    values = 0.1 * random.standard_normal(len(time))
    for k, true in enumerate(lines):
        values += (3.0 - k) * np.sin(2 * np.pi * true * time)
    frequency, density = spectrum(*evenly(time, values[:, None]))
    found = lines_of(frequency, density[:, 0], ROTORS, 15.0)
    assert [line.source for line in found] == list(lines.values())
    assert [line.frequency for line in found] == pytest.approx(list(lines), abs=0.5)
    level = lines_of(frequency, density[:, 0], np.full(4, 95.0), 15.0)
    assert level[1].source == "blades"  # if rotors turn at the same rate, it may be of any


@pytest.mark.parametrize(("hertz", "amplitude"), [(30.0, 0.5), (86.0, 0.1)])
def test_no_notch_is_proposed_for_a_slow_or_a_weak_line(hertz: float, amplitude: float) -> None:
    time, values = noise(5, DENSITY)
    values += amplitude * np.sin(2 * np.pi * hertz * time)[:, None] * (DENSITY / DENSITY[0])
    found = estimated(noise(105, 0.2 * DENSITY), (time, values))
    strongest = found.sensors["gyroscope"].lines[0]
    assert strongest.frequency == pytest.approx(hertz, abs=0.5)
    assert found.notch == 0.0
    assert "estimation.rate_notch" not in found.record().values


def test_rotors_turn_as_their_thrust_asks_for() -> None:
    assert rotor_frequency(THRUST_PER_TURN * ROTORS**2) == pytest.approx(ROTORS)
    assert rotor_frequency(np.array([-1.0, 0.0])) == pytest.approx([0.0, 0.0])


def test_what_says_nothing_is_refused() -> None:
    still, flown = noise(1, DENSITY), noise(2, DENSITY)
    time, values = still
    turned = values + np.radians(2.0) * (time > 10.0)[:, None] * np.eye(6)[3]
    with pytest.raises(MeasurementError, match=r"moved at rest: the gyroscope's"):
        estimated((time, turned), flown)
    with pytest.raises(MeasurementError, match="too short"):
        estimated(still, noise(2, DENSITY, 2.0))
    holes = np.arange(len(flown[0])) % 50 > 5
    with pytest.raises(MeasurementError, match="samples were received"):
        estimated(still, (flown[0][holes], flown[1][holes]))
    with pytest.raises(MeasurementError, match="outside what the estimator accepts"):
        estimated(still, noise(2, 200.0 * DENSITY)).record()


def test_a_log_without_imu_says_so(tmp_path: Path) -> None:
    log = tmp_path / "empty.mcap"
    LogWriter(log, {}, {"parameters.json": b'{"model.mass": 1.3}'}).close()
    with pytest.raises(LogFormatError, match="imu"):
        read_vibration(log, "quad1")
