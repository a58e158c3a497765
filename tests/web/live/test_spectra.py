"""Live spectra use every tick of the last seconds, as received by telemetry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from quadrotor.constants import THRUST_PER_TURN
from quadrotor.errors import MeasurementError, OutOfBoundsError
from quadrotor.records import TICK, Record
from tests.support.live_signals import Received
from web.live.signal_log import SignalLog
from web.live.spectra import live_spectrogram, recent, spectra

RATE, TURNS, DENSITY = 500.0, 76.0, 0.03


def flown(seconds: float) -> Record:
    """Return ticks with known noise on the gyroscope's x, a rotor's line on its y, slow roll."""
    count = int(RATE * seconds)
    ticks, random = np.zeros(count, TICK), np.random.default_rng(4)
    time = np.arange(count) / RATE
    ticks["imu"]["stamp_ns"] = 10**18 + np.round(1e9 * time).astype(np.int64)
    rates = ticks["imu"]["angular_velocity_b"]
    rates[:, 0] = DENSITY * math.sqrt(RATE) * random.standard_normal(count)
    rates[:, 1] = 0.2 * np.sin(2.0 * math.pi * TURNS * time)
    half = 0.05 * np.sin(2.0 * math.pi * 5.0 * time)  # rad
    ticks["state"]["quaternion_wb"][:, 0] = np.cos(half)
    ticks["state"]["quaternion_wb"][:, 1] = np.sin(half)
    ticks["actuators"]["thrusts"] = THRUST_PER_TURN * TURNS**2
    return ticks


def log_of(ticks: Record) -> SignalLog:
    received = Received()
    received.ticks(ticks)
    return received.log


def test_spectra_have_the_density_of_the_noise_and_the_line_at_the_rotors_frequency() -> None:
    names = ["imu.angular_velocity.x", "imu.angular_velocity.y"]
    found = spectra(recent(log_of(flown(5.0)), names))
    assert [one["signal"] for one in found["spectra"]] == names
    noise, line = (np.array(one["density"]) for one in found["spectra"])
    frequency = np.array(found["spectra"][0]["frequency"])
    assert frequency[-1] == RATE / 2.0
    assert np.sqrt(np.mean(noise[5:-5] ** 2)) == pytest.approx(DENSITY, rel=0.06)
    assert frequency[line.argmax()] == pytest.approx(TURNS, abs=1.0)
    power = 2.0 * float(np.sum(line**2)) * frequency[1]
    assert power == pytest.approx(0.5 * 0.2**2, rel=0.02)
    assert found["rotors"] == pytest.approx([TURNS] * 4, abs=0.05)


def test_a_signal_made_of_several_numbers_is_in_its_own_unit() -> None:
    found = spectra(recent(log_of(flown(5.0)), ["state.roll"]))
    [roll] = found["spectra"]
    power = 2.0 * float(np.sum(np.square(roll["density"]))) * roll["frequency"][1]
    assert power == pytest.approx(0.5 * math.degrees(0.1) ** 2, rel=0.03)


def test_a_derived_signal_has_a_spectrum() -> None:
    name = "= deg(imu.angular_velocity.x)"
    [one] = spectra(recent(log_of(flown(5.0)), [name]))["spectra"]
    noise = np.sqrt(np.mean(np.square(one["density"][5:-5])))
    assert noise == pytest.approx(math.degrees(DENSITY), rel=0.06)


def test_lost_ticks_are_borne_and_too_many_lost_are_told() -> None:
    ticks, name = flown(5.0), "imu.angular_velocity.y"
    some = np.concatenate([ticks[:100], ticks[50:65], ticks[125:]])
    [line] = spectra(recent(log_of(some), [name]))["spectra"]
    assert line["frequency"][int(np.argmax(line["density"]))] == pytest.approx(TURNS, abs=1.0)
    with pytest.raises(MeasurementError, match="samples were received"):
        spectra(recent(log_of(np.concatenate([ticks[:500], ticks[1000:]])), [name]))


def test_a_spectrogram_has_the_line_at_each_time_of_the_page_s_frames() -> None:
    log = log_of(flown(5.0))
    found = live_spectrogram(recent(log, ["imu.angular_velocity.y"]))
    times, frequency = np.array(found["times"]), np.array(found["frequency"])
    assert times[0] == pytest.approx(0.25, abs=2e-3)  # the middle of half a second
    assert np.all(np.diff(times) < 0.5)
    assert times[-1] > log.now - 0.5
    density = np.array(found["density"])
    assert density.shape == (len(times), len(frequency))
    assert frequency[density.argmax(axis=1)] == pytest.approx(np.full(len(times), TURNS), abs=1.0)
    assert np.array(found["rotors"]) == pytest.approx(np.full((4, len(times)), TURNS), abs=0.05)


def test_what_has_no_live_spectrum_says_why() -> None:
    with pytest.raises(MeasurementError, match=r"0\.0 s of telemetry so far"):
        recent(SignalLog(), ["state.roll"])
    with pytest.raises(MeasurementError, match=r"1\.0 s of telemetry so far"):
        recent(log_of(flown(1.0)), ["state.roll"])
    log = log_of(flown(3.0))
    with pytest.raises(OutOfBoundsError, match="not sampled at the flight rate"):
        recent(log, ["battery.voltage"])
    with pytest.raises(OutOfBoundsError, match="not known"):
        recent(log, ["nonsense"])
