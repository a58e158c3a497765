"""Experiments that find mass and inertia: what they find, propose and refuse, from logs alone."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.evaluation.inertia import WANTED, estimate_inertia, read_inertia
from console.evaluation.log_columns import read_columns, read_parameters
from console.evaluation.mass import read_mass
from console.experiments.client import ExperimentEndedError, VehicleView
from console.experiments.figure_eight import FigureEight
from console.experiments.inertia import InertiaExperiment
from flight_log import LogWriter
from flight_log.fields import THRUSTS, TURNING_B
from quadlab.simulated.flight import SimulatedFlight
from quadrotor.errors import LogFormatError, MeasurementError, RefusedError, UsageError
from tests.support.laboratory import laboratory

INERTIA = np.array([0.0154, 0.0154, 0.0250])


@pytest.fixture(scope="module")
def weighed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path, SimulatedFlight]:
    """Return a flight with less thrust than commanded, which makes the vehicle seem heavier."""
    log = tmp_path_factory.mktemp("mass") / "mass.mcap"
    settings = {
        "experiment__duration": 6.0,
        "experiment__climb": 0.3,
        "simulator__thrust_efficiency": 0.938,
    }
    with laboratory("mass", log, **settings) as (experiment, flight):
        experiment.fly(flight)
    return experiment, log, flight


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    log = tmp_path_factory.mktemp("inertia") / "inertia.mcap"
    settings = {"experiment__excitation": "quick"}
    with laboratory("inertia", log, **settings) as (experiment, flight):
        experiment.fly(flight)
    return experiment, log


Weighed = tuple[Any, Path, SimulatedFlight]
Turned = tuple[Any, Path]


# ---------------------------------------------------------------- mass
def test_the_mass_is_found_in_a_flight_that_begins_too_light(weighed: Weighed) -> None:
    experiment, log, _ = weighed
    result = pickle.loads(pickle.dumps(experiment)).evaluate(log)
    found = result.metrics
    assert result.verdict == "passed"
    assert found["truth_kg"] == pytest.approx(1.394, abs=0.001)
    assert found["mass_kg"] == pytest.approx(found["truth_kg"], rel=0.007)
    assert found["erratic_std_kg"] <= 0.002
    assert found["within_1_percent_s"] <= 3.0
    assert 1.0 < found["lift_off_s"] < 5.0
    assert found["erratic_s"] == pytest.approx(6.0, abs=0.5)


def test_the_mass_proposes_one_value_with_how_good_it_is(weighed: Weighed) -> None:
    record = weighed[0].proposal(weighed[1])
    assert record.name == "mass"
    assert record.good
    assert record.values == {"model.mass": pytest.approx(1.3945, rel=0.005)}
    assert {figure.name for figure in record.quality} == {
        "standard error of the mean, share",
        "within 1 % after",
    }
    assert len(record.residuals) == 6
    assert record.conditions["first guess"] == "1 kg"
    assert record.run_id == record.requester == ""
    assert record.stamp_ns == 0


def test_what_the_law_flies_on_is_put_back(weighed: Weighed) -> None:
    _, _, flight = weighed
    assert flight.parameter("mass.used_by") == "model"
    assert flight.parameter("mass.initial") == 0.0
    assert flight.view().mode == "ready"


def test_after_a_take_over_the_next_flight_does_not_begin_too_light(tmp_path: Path) -> None:
    """The script may send nothing more then, so it must have restored the mass before."""

    class TakenOver:
        def __init__(self, flight: SimulatedFlight) -> None:
            self.flight = flight

        def __getattr__(self, name: str) -> Any:
            if self.flight.view().position_w[2] > 0.3:
                raise ExperimentEndedError("anna flies")
            return getattr(self.flight, name)

    with laboratory("mass", tmp_path / "m.mcap", experiment__climb=0.4) as (experiment, flight):
        with pytest.raises(ExperimentEndedError, match="anna flies"):
            experiment.fly(TakenOver(flight))
        assert flight.view().airborne
        assert flight.parameter("mass.used_by") == "estimate"
        assert flight.parameter("mass.initial") == 0.0


def test_a_vehicle_that_does_not_lift_off_ends_with_the_reason_and_as_it_was(
    tmp_path: Path,
) -> None:
    settings = {
        "experiment__initial": 0.5,
        "experiment__climb": 0.5,
        "experiment__height": 0.6,
        "mass__initial": 1.2,
    }
    with laboratory("mass", tmp_path / "mass.mcap", **settings) as (experiment, flight):
        with pytest.raises(RefusedError, match=r"lift-off.* 0\.5 kg .* 0\.6 m"):
            experiment.fly(flight)
        assert flight.parameter("mass.used_by") == "model"
        assert flight.parameter("mass.initial") == 1.2
        assert not flight.view().armed
    with pytest.raises(MeasurementError, match="never left the ground"):
        experiment.evaluate(tmp_path / "mass.mcap")


# ---------------------------------------------------------------- inertia
def test_three_axes_are_found_within_three_percent(turned: Turned) -> None:
    experiment, log = turned
    result = pickle.loads(pickle.dumps(experiment)).evaluate(log)
    assert result.verdict == "passed"
    for axis in ("xx", "yy", "zz"):
        assert result.metrics[f"error_{axis}_share"] <= 0.03
    assert result.metrics["missing_share"] == 0.0


def test_the_inertia_proposes_three_values(turned: Turned) -> None:
    record = turned[0].proposal(turned[1])
    assert record.name == "inertia"
    assert record.good
    found = [record.values[f"model.inertia_{axis}"] for axis in ("xx", "yy", "zz")]
    np.testing.assert_allclose(found, INERTIA, rtol=0.03)
    assert len(record.values) == 3


def test_its_convergence_is_in_the_log(turned: Turned) -> None:
    flight = read_inertia(turned[1], "quad1")
    assert flight.inertia_b.shape == (len(flight.time), 3)
    np.testing.assert_allclose(flight.inertia_b[0], 0.03)
    assert (flight.settled_b < flight.time[-1] - flight.time[0]).all()


def test_packets_that_were_lost_are_counted_and_do_not_spoil_it(turned: Turned) -> None:
    """One packet of five ticks in ten is lost, as over the air."""
    columns = read_columns(turned[1], "quad1", WANTED)
    whole = read_inertia(turned[1], "quad1")
    state, actuators = columns["state"], columns["actuators"]
    kept = (state.time >= whole.time[0] - 0.01) & (state.time <= whole.time[-1])
    kept &= np.random.default_rng(1).random(len(state.time) // 5 + 1).repeat(5)[: len(kept)] > 0.1
    rates = np.stack([state.values(name)[kept] for name in TURNING_B], axis=1)
    thrusts = np.stack([actuators.values(name)[kept] for name in THRUSTS], axis=1)
    found = estimate_inertia(state.time[kept], rates, thrusts, whole.parameters)
    assert found.missing == pytest.approx(0.1, abs=0.03)
    np.testing.assert_allclose(found.found_b, INERTIA, rtol=0.03)
    assert "ticks are not in the log" in found.record().warnings[0]


def test_a_weak_excitation_proposes_nothing(turned: Turned) -> None:
    columns = read_columns(turned[1], "quad1", WANTED)["state"]
    still = np.zeros((2000, 3))
    thrusts = np.full((2000, 4), 3.2)
    flight = estimate_inertia(columns.time[:2000], still, thrusts, read_parameters(turned[1]))
    with pytest.raises(MeasurementError, match=r"excitation about x was too weak: 0\.0 mN m"):
        flight.record()


def test_an_excitation_that_the_vehicle_ends_is_told_and_it_lands(tmp_path: Path) -> None:
    settings = {"control__limits__tilt_max": 10.0, "experiment__excitation": "slow"}
    with laboratory("inertia", tmp_path / "i.mcap", **settings) as (experiment, flight):
        with pytest.raises(RefusedError, match=r"vehicle ended the excitation of x by itself"):
            experiment.fly(flight)
        assert not flight.view().armed


def test_the_same_seed_excites_the_same_and_no_more_than_is_allowed() -> None:
    one, again, other = (InertiaExperiment() for _ in range(3))
    other.parameters.seed = 2
    assert one.excitations() == again.excitations() != other.excitations()
    assert [step["axis"] for step in one.excitations()] == ["x", "y", "yaw"] * 2
    for step in one.excitations():
        most = 0.5 if step["axis"] == "yaw" else 0.25
        assert abs(float(step["amplitude"])) <= most


def test_it_is_ended_a_metre_from_where_it_hovered() -> None:
    def view(x: float, z: float) -> VehicleView:
        return VehicleView(0.0, "armed", "excite", True, True, np.array([x, 0.0, z]))

    experiment = InertiaExperiment()
    assert experiment.abort(view(5.0, 1.2)) == ""  # not hovering yet
    experiment._place = (0.0, 0.0, 1.2)
    assert experiment.abort(view(0.3, 1.0)) == ""
    assert "1.1 m from where it hovered" in experiment.abort(view(1.1, 1.2))
    assert "0.6 m below where it hovered" in experiment.abort(view(0.0, 0.6))
    assert experiment.abort(view(float("nan"), 1.2)) != ""


# ---------------------------------------------------------------- logs that tell nothing
def test_a_log_of_something_else_is_refused_with_what_is_missing(
    weighed: Weighed, turned: Turned, tmp_path: Path
) -> None:
    with pytest.raises(MeasurementError, match="nothing was excited in flight"):
        read_inertia(weighed[1], "quad1")
    with pytest.raises(LogFormatError, match="no messages of estimator, status of quad7"):
        read_mass(turned[1], "quad7")
    empty = tmp_path / "empty.mcap"
    LogWriter(empty, {}, {}).close()
    with pytest.raises(LogFormatError, match="no parameters of the vehicle"):
        read_mass(empty, "quad1")


def test_a_station_s_run_has_no_truth_and_is_judged_without_it(
    weighed: Weighed, tmp_path: Path
) -> None:
    """Its parameters are the vehicle's, in addition to the station's own."""
    _, log, _ = weighed
    values = read_parameters(log).vehicle
    content = {"vehicle": {k: v for k, v in values.items() if "simulator" not in k}, "station": {}}
    run = tmp_path / "run.mcap"
    LogWriter(run, {}, {"parameters.json": json.dumps(content).encode()}).close()
    assert read_parameters(run).truth == {}
    assert read_parameters(run).vehicle["model.mass"] == 1.308


# ---------------------------------------------------------------- the 8 from rest to rest
def test_the_eight_rest_to_rest_stays_within_20_mm(tmp_path: Path) -> None:
    log = tmp_path / "eight.mcap"
    settings = {"experiment__laps": "rest_to_rest", "experiment__yaw_amplitude": 0.2}
    with laboratory("figure_eight", log, **settings) as (experiment, flight):
        experiment.fly(flight)
        assert flight.parameter("behavior.trajectory_acceleration_max") == 4.0
    result = experiment.evaluate(log)
    assert result.verdict == "passed"
    assert result.metrics["position_rms_m"] <= 0.020
    assert result.metrics["samples"] == pytest.approx(800, abs=10)


def test_a_yaw_that_one_lap_cannot_have_is_refused_before_it_flies() -> None:
    experiment = FigureEight()
    experiment.check()
    experiment.parameters.laps = "rest_to_rest"
    with pytest.raises(UsageError, match=r"yaw amplitude 1 rad needs too much.*at most 0.7"):
        experiment.check()
