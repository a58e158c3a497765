"""Base stations are found from the sweeps and the IMU of a flight, without its truth."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from extensions.offline import survey
from extensions.offline.lines import Run, plan_runs
from extensions.offline.run import replay
from extensions.offline.survey import survey_beacons, survey_stations
from quadlab.recording.log import Arrival, Recording
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import MeasurementError
from quadrotor.records import IMU_SAMPLE, STATE, bearings_sample, pose_sample
from tests.support.sweeps import sweeps_of

MOVED = np.array([0.06, -0.03, 0.04])
"""Displacement of station 1 from its assumed place, m."""
RATE = 100


def circling(seconds: float) -> tuple[Recording, npt.NDArray[np.float64]]:
    """Return a level flight on a slanted 8 below two stations, and its path.

    One of the stations is assumed at another place.
    """
    rng, arrivals = np.random.default_rng(8), []
    t = np.arange(1, round(RATE * seconds)) / RATE
    path = np.column_stack([np.sin(1.5 * t), np.sin(3.0 * t) / 2, 1.0 + 0.3 * np.sin(2.0 * t)])
    imu = np.zeros(len(t), IMU_SAMPLE)
    imu["stamp_ns"] = np.round(1e9 * t)
    imu["specific_force_b"] = np.column_stack(
        [-2.25 * np.sin(1.5 * t), -4.5 * np.sin(3.0 * t), 9.80665 - 1.2 * np.sin(2.0 * t)]
    )
    imu["specific_force_b"] += 0.05 * rng.normal(size=(len(t), 3))
    imu["angular_velocity_b"] = 0.005 * rng.normal(size=(len(t), 3))
    for k in range(0, len(t), 2):
        number = (k // 2) % 4
        frame = sweeps_of(number, int(imu["stamp_ns"][k]), path[k], rng)
        if number // 2 == 1:
            frame["plane"]["origin_w"] += MOVED
        arrivals.append(Arrival(int(imu["stamp_ns"][k]), frame))
    nothing = np.zeros(0, np.int64)
    recording = Recording(
        Path("flight.mcap"),
        "quad1",
        imu,
        nothing,
        np.zeros(0, STATE),
        nothing,
        np.zeros(0, STATE),
        poses=[],
        bearings=[],
        sweeps=arrivals,
        parameters=FlightParameters(),
    )
    return recording, path


def error(recording: Recording, run: Run, path: npt.NDArray[np.float64]) -> float:
    """Return the rms error of the path, after aligning it with the true one, m."""
    flown = replay(recording, run, recording.sweeps).states["position_w"][2 * RATE :]
    true = path[2 * RATE :]
    _, rest = Rotation.align_vectors(true - true.mean(axis=0), flown - flown.mean(axis=0))
    return float(rest) / math.sqrt(len(true))


def test_a_base_station_that_is_elsewhere_is_found_without_the_truth() -> None:
    recording, path = circling(16.0)
    [run] = plan_runs(recording, (), ["error_state"], (), "sweeps")
    before = error(recording, run, path)
    found = survey_stations(recording, run)
    assert error(recording, run, path) < 0.5 * before
    assert found.after < 0.5 * found.before
    assert np.isnan(found.places[0].deviation_w).all()


LEDS = np.array([[2.5, 1.0, 0.5], [2.5, -1.0, 0.5], [2.5, -1.0, 2.0], [2.5, 1.0, 2.0]])
"""Places of LEDs, m; each picture shows two of them."""
ASSUMED = "1 2.54 0.97 0.54; 2 2.45 -0.96 0.47; 3 2.53 -1.04 2.03; 4 2.46 1.05 1.98"


def test_leds_whose_bearings_are_better_than_stated_are_found_to_some_millimetres() -> None:
    recording, path = circling(6.0)
    rng, level = np.random.default_rng(6), np.array([1.0, 0.0, 0.0, 0.0])
    poses, bearings = [], []
    for k, stamp_ns in enumerate(recording.imu["stamp_ns"].tolist()):
        if k % 2 == 0:
            seen = path[k] + 0.001 * rng.normal(size=3)
            poses.append(Arrival(stamp_ns, pose_sample(stamp_ns, seen, level)))
        if k % 5 == 0:
            ids = np.array([1, 2] if k // 100 % 2 else [3, 4], np.int32)
            away_b = LEDS[ids - 1] - path[k]
            away_b /= np.linalg.norm(away_b, axis=1)[:, None]
            away_b += 2e-4 * rng.normal(size=away_b.shape)
            frame = bearings_sample(stamp_ns, ids, away_b, math.radians(0.22))
            bearings.append(Arrival(stamp_ns, frame))
    parameters = FlightParameters()
    parameters.beacons.layout = ASSUMED
    seen_all = replace(recording, poses=poses, bearings=bearings, sweeps=[], parameters=parameters)
    [run] = plan_runs(seen_all, (), ["error_state"], (), "both")
    arrivals = sorted([*poses, *bearings], key=lambda one: one.arrival_ns)
    found, _ = survey_beacons(seen_all, run, arrivals)
    assert np.linalg.norm(found.positions_w - LEDS, axis=1).max() < 0.01


def test_a_survey_of_few_sweeps_is_refused() -> None:
    recording, _ = circling(0.4)
    [run] = plan_runs(recording, (), ["error_state"], (), "sweeps")
    with pytest.raises(MeasurementError, match=r"\b\d+ sweeps .* which needs 100"):
        survey_stations(recording, run)


def test_a_survey_that_worsens_what_it_began_with_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recording, _ = circling(4.0)
    [run] = plan_runs(recording, (), ["error_state"], (), "sweeps")
    monkeypatch.setattr(survey, "LEAST", 10)

    def worse(residual: Any, began: npt.NDArray[np.float64], *_: Any, **__: Any) -> Any:
        return SimpleNamespace(x=began + np.tile([0.0, 0.0, 0.2, 0.0, 0.0, 0.0], 2))

    monkeypatch.setattr(survey, "least_squares", worse)
    before = [one.measurement.copy() for one in recording.sweeps]
    with pytest.raises(MeasurementError, match=r"finds no layout near .* that fits better"):
        survey_stations(recording, run)
    assert all(
        (old == new.measurement).all() for old, new in zip(before, recording.sweeps, strict=True)
    )
