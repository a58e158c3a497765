"""Flights of the experiments: what they find and propose, from logs alone."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from console.experiments.catalogue import experiments, find
from console.experiments.client import Calibrating
from console.reports.flight import flight_of
from console.reports.judgement import Judgement
from console.reports.run_log import read_run
from extensions.identification.residual.fit import fit_residual
from extensions.identification.residual.flights import read_residual
from extensions.reports.experiment_figures import experiment_pictures
from quadrotor.errors import LogFormatError
from tests.support.laboratory import laboratory


def test_they_are_listed_after_those_of_the_paper() -> None:
    names = list(experiments())
    mine = ["drag", "drag_optimal", "vibration", "tracker_delay", "tracker_body"]
    assert [name for name in names if name in mine] == mine
    assert names.index("inertia") < names.index("drag")


# ---------------------------------------------------------------- drag
@pytest.mark.parametrize(
    ("name", "options", "speed"),
    [("drag", {"experiment__laps": 3}, 1.0), ("drag_optimal", {"experiment__seconds": 6.0}, 1.7)],
)
def test_drag_is_found_on_circles_and_proposed_for_the_model(
    name: str, options: dict[str, float], speed: float, tmp_path: Path
) -> None:
    log = tmp_path / "drag.mcap"
    settings = options | {
        "simulator__rotor_drag_x": 0.2,
        "simulator__rotor_drag_y": 0.2,
        "simulator__drag_lever": 0.03,
    }
    with laboratory(name, log, **settings) as (experiment, flight):
        experiment.fly(flight)
        assert flight.view().mode == "ready"
    result = experiment.evaluate(log)
    assert result.verdict == "passed"
    assert result.metrics["drag_N_s_m"] == pytest.approx(0.2, abs=0.01)
    assert result.metrics["speed_rms_m_s"] == pytest.approx(speed, rel=0.15)
    assert experiment.proposal(log).values == {
        "model.drag": pytest.approx(0.2, abs=0.01),
        "model.drag_lever": pytest.approx(0.03, abs=0.005),
    }
    residual = fit_residual([read_residual(log, "quad1")])
    assert residual.simulator() == {
        "simulator.rotor_drag_x": pytest.approx(0.2, abs=0.01),
        "simulator.rotor_drag_y": pytest.approx(0.2, abs=0.01),
        "simulator.drag_lever": pytest.approx(0.03, abs=0.005),
    }
    assert list(residual.quiet) == ["z"]  # circles are level


# ---------------------------------------------------------------- vibration
def test_the_noise_of_a_rough_vehicle_is_found_in_hover_and_proposed(tmp_path: Path) -> None:
    log = tmp_path / "vibration.mcap"
    settings = {
        "simulator__vibration": 0.5,
        "simulator__vibration_gyroscope": 1.0,
        "experiment__rest": 9.0,
        "experiment__hover": 9.0,
    }
    with laboratory("vibration", log, **settings) as (experiment, flight):
        experiment.fly(flight)
        assert flight.view().mode == "ready"
    result = pickle.loads(pickle.dumps(experiment)).evaluate(log)
    assert result.verdict == "passed"
    # The broadband share of the vibration and the sensors' own noise, quantised, at 500 Hz.
    assert experiment.proposal(log).values == {
        "estimation.error_state.accelerometer_noise": pytest.approx(0.0123, rel=0.05),
        "estimation.error_state.gyroscope_noise": pytest.approx(0.029, rel=0.05),
        "estimation.rate_notch": pytest.approx(76.0, abs=1.0),
    }
    run = read_run(log)
    pictures, missing = experiment_pictures(run, flight_of(run), Judgement("vibration"))
    assert [picture.title for picture in pictures] == ["Spectra", "Spectrograms"]
    assert missing == []


# ---------------------------------------------------------------- tracker
def test_a_tracker_late_and_askew_is_found_by_hand(tmp_path: Path) -> None:
    log = tmp_path / "tracker.mcap"
    body = {"x": 0.05, "y": -0.03, "z": 0.04, "roll": 3.0, "pitch": -2.0, "yaw": 100.0}
    settings = {f"tracker__body__{name}": value for name, value in body.items()}
    settings |= {"tracker__delay": 0.04, "tracker__stamp_error": 0.04, "experiment__duration": 30.0}
    with laboratory("tracker_body", log, **settings) as (experiment, flight):
        experiment.fly(flight)
        assert flight.view().mode == "ready"
    found = pickle.loads(pickle.dumps(experiment)).proposal(log).values
    for name, value in body.items():
        near = 0.002 if name in "xyz" else 0.2
        assert found[f"estimation.tracker.{name}"] == pytest.approx(value, abs=near)
    late = find("tracker_delay")
    assert isinstance(late, Calibrating)
    assert late.evaluate(log).verdict == "passed"
    delay = late.proposal(log).values
    assert delay == {"estimation.tracker.delay": pytest.approx(0.04, abs=1e-3)}


def test_a_tracker_that_sends_nothing_cannot_be_identified(tmp_path: Path) -> None:
    log = tmp_path / "tracker.mcap"
    settings = {"tracker__drop_out": 1.0, "experiment__duration": 15.0}
    with laboratory("tracker_delay", log, **settings) as (experiment, flight):
        experiment.fly(flight)
    with pytest.raises(LogFormatError, match="tracker_pose"):
        experiment.evaluate(log)
