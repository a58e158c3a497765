"""Forces and torques of a moment, and poses that scatter, where all other witnesses agree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from console.evaluation.findings import Finding
from extensions.explanation.explain import explain
from extensions.explanation.tests.made_flight import PARAMETERS, Columns, Flight
from extensions.explanation.tests.test_diagnosis import numbers
from quadrotor.rotations import rotation_exp

INERTIA = np.array([0.0154, 0.0154, 0.025])
KNOWN = PARAMETERS | {
    f"model.inertia_{axis}": float(value)
    for axis, value in zip(("xx", "yy", "zz"), INERTIA, strict=True)
}
Rows = npt.NDArray[np.bool_]
Wrong = Callable[[Flight, Rows], None]
AT, LASTS = 20.0, 0.4  # s


def explained(wrong: Wrong) -> list[Finding]:
    """Return what is found where something is wrong for a moment; the torques are those flown."""
    flight = Flight()
    smooth = np.apply_along_axis(np.convolve, 0, flight.rates, np.full(50, 0.02), "same")
    flight.torque = INERTIA * np.gradient(smooth, 0.002, axis=0)
    during = (flight.time >= AT) & (flight.time < AT + LASTS)
    wrong(flight, during)
    return explain(flight.topics(), KNOWN)


def torque(flight: Flight, during: Rows) -> None:
    flight.torque[during, 1] -= 0.08


def little_torque(flight: Flight, during: Rows) -> None:
    flight.torque[during, 1] -= 0.01


def push(flight: Flight, during: Rows) -> None:
    flight.thrust[during] *= 0.88


def misread(flight: Flight, during: Rows) -> None:
    flight.felt[during, 2] += 1.5


def noise(flight: Flight, during: Rows) -> None:
    noisy = (flight.poses >= AT) & (flight.poses < AT + 6.0)
    flight.tracked[noisy] += 0.02 * flight.chance.normal(size=(int(noisy.sum()), 3))


@pytest.mark.parametrize(
    ("wrong", "kind", "figure", "near"),
    [
        (torque, "outside_torque", 80.0, 4.0),
        (push, "thrust_off", 1.2, 0.1),
        (noise, "tracker_noisy", 20.0, 4.0),
    ],
)
def test_what_acts_for_a_moment_is_named_with_its_figure(
    wrong: Wrong, kind: str, figure: float, near: float
) -> None:
    [found] = [one for one in explained(wrong) if not one.follows]
    assert found.kind == kind
    assert found.start == pytest.approx(AT, abs=0.4 if kind != "tracker_noisy" else 2.0)
    assert any(abs(one - figure) <= near for one in numbers(found.claim)), found.claim


def held_by_the_board(flight: Flight, during: Rows) -> None:
    swing = 1.0 - np.cos(2.0 * np.pi * (flight.time[during] - AT) / LASTS)
    flight.rates[during, 0] += 0.3 * swing
    flight.torque[during] = 0.0  # of the board's own nothing is known


def standing_until_it_takes_off(flight: Flight, _: Rows) -> None:
    flight.airborne = (flight.time > 18.0) & (flight.time < 22.0)
    flight.torque[(flight.time > 17.6) & (flight.time < 18.2), 1] -= 0.08


@pytest.mark.parametrize(
    "wrong",
    [
        lambda flight, during: None,
        little_torque,
        misread,
        held_by_the_board,
        standing_until_it_takes_off,
    ],
)
def test_no_force_is_claimed_that_one_witness_alone_shows(wrong: Wrong) -> None:
    kinds = [one.kind for one in explained(wrong)]
    assert not {"outside_torque", "outside_force", "thrust_off"} & set(kinds)


def test_poses_that_jump_alone_are_named_and_follow_from_another_cause_of_the_tracker() -> None:
    def jump(flight: Flight, during: Rows) -> None:
        flight.tracked[flight.poses >= AT, 0] += 0.03

    def noisy_jump(flight: Flight, during: Rows) -> None:
        jump(flight, during)
        noise(flight, during)

    [alone] = [one for one in explained(jump) if not one.follows]
    assert alone.kind == "tracker_jumped"
    assert alone.start == pytest.approx(AT, abs=0.4)
    found = {one.kind: one.follows for one in explained(noisy_jump)}
    assert found == {"tracker_noisy": False, "tracker_jumped": True}


def test_what_turns_a_vehicle_over_in_its_last_moment_is_named() -> None:
    def blow(flight: Flight, _: Rows) -> None:
        flight.torque[(flight.time >= 33.5) & (flight.time < 34.0), 1] -= 0.08
        fallen = flight.poses >= 34.0
        flight.tracked_R_wb = flight.tracked_R_wb.copy()
        flight.tracked_R_wb[fallen] = rotation_exp(np.radians([85.0, 0.0, 0.0]))

    assert "outside_torque" in [one.kind for one in explained(blow)]


@pytest.mark.parametrize("end", [30.0, 7.5])  # 2.5 s after the take-off
def test_a_log_that_ends_in_flight_is_named(end: float) -> None:
    topics = Flight().topics()
    status = topics["status"]
    flown = status.time < end
    topics["status"] = Columns(status.time[flown], {"airborne": status.values("airborne")[flown]})
    [found] = explain(topics, KNOWN | {"model.inertia_xx": 0.0})
    assert found.kind == "ended_in_flight"
    assert found.end == pytest.approx(end, abs=0.2)


def test_a_gap_of_the_imu_that_ends_a_flight_is_named() -> None:
    topics = Flight().topics()
    imu = topics["imu"]
    imu.time = np.where(imu.time < 32.5, imu.time, imu.time + 3.0)
    assert "imu_gaps" in [one.kind for one in explain(topics, PARAMETERS)]


def test_a_flight_of_some_seconds_is_explained_too() -> None:
    flight = Flight()
    flight.airborne = (flight.time > 18.0) & (flight.time < 22.0)
    flight.tracked[(flight.poses >= 20.0) & (flight.poses < 20.5)] = flight.tracked[0]
    assert explain(flight.topics(), PARAMETERS)[0].kind == "tracker_frozen"
