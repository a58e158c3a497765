"""Behavior excite: pure steps on one axis, refused or ended where they would lead too far."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from control.behaviors.machine import BehaviorMachine
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from control.parameters import ControlParameters
from control.trajectories.multistep import LEAD, Multistep
from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record, new_reference, new_state
from tests.support.arrays import Array

DT = 0.002
WEIGHT = 1.308 * 9.81
POINT = {"x": 0.4, "y": -0.3, "z": 1.2, "yaw": 0.7}


class Bench:
    """Machine in hover at POINT; the vehicle stays where the test sets it."""

    def __init__(self, **changes: Any) -> None:
        self.machine = BehaviorMachine(BehaviorParameters(**changes), WEIGHT)
        self.state, self.reference = new_state(), new_reference()
        self.put(0.0, 0.0, 0.05)
        self.machine.request("take_off", {"height": 1.15}, self.state, True, True)
        self.fly(6.0)
        self.machine.request("fly_to", POINT, self.state, True, True)
        self.fly(6.0)
        assert self.machine.name is BehaviorName.HOVER
        self.put(POINT["x"], POINT["y"], POINT["z"], POINT["yaw"])

    def put(self, x: float, y: float, z: float, yaw: float = 0.0) -> None:
        self.move_to(np.array([x, y, z]), yaw)

    def move_to(self, place: Array, yaw: float) -> None:
        self.state["position_w"] = place
        self.state["quaternion_wb"] = (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2))

    def flies(self, name: BehaviorName) -> bool:
        return self.machine.name is name

    def fly(self, seconds: float) -> Record:
        """Return the references of this time, (N,)."""
        out = []
        for _ in range(round(seconds / DT)):
            self.machine.step(0, DT, self.state, None, WEIGHT, self.reference)
            out.append(self.reference.copy())
        return np.concatenate(out)

    def excite(self, airborne: bool = True, **arguments: float | str) -> None:
        self.machine.request("excite", arguments, self.state, True, airborne)

    def refusal(self, airborne: bool = True, **arguments: ParameterValue) -> str:
        with pytest.raises(QuadlabError) as caught:
            self.excite(airborne, **arguments)
        assert self.machine.name is BehaviorName.HOVER
        return str(caught.value)


@pytest.fixture
def bench() -> Bench | Bench:
    return Bench()


def along(references: Record, axis: str) -> Array:
    if axis == "yaw":
        return references["yaw"]
    return references["position_w"][:, "xyz".index(axis)]


@pytest.mark.parametrize("axis", ["x", "y", "z", "yaw"])
@pytest.mark.parametrize(("shape", "levels"), [("step", [0.2, 0.0]), ("doublet", [0.2, -0.2, 0.0])])
def test_the_set_point_jumps_between_its_levels_and_nothing_else_moves(
    bench: Bench, axis: str, shape: str, levels: list[float]
) -> None:
    bench.excite(axis=axis, shape=shape, amplitude=0.2, duration=0.4, repeats=2)
    path = bench.fly(LEAD + 2 * len(levels) * 0.4 + 0.1)
    assert bench.machine.name is BehaviorName.HOVER
    offset = along(path, axis) - along(path, axis)[0]
    assert np.unique(offset.round(9)).tolist() == sorted({0.0, *levels})
    jumps = np.flatnonzero(np.abs(np.diff(offset)) > 1e-9)
    times = (jumps + 2) * DT  # a reference is that at the end of its tick
    # Durations are summed tick by tick: an edge may be one tick late.
    expected = LEAD + 0.4 * np.arange(2 * len(levels))
    expected = expected[: len(times)]
    assert np.all(times - expected >= -1e-9)
    assert np.all(times - expected <= DT + 1e-9)
    for field in ("velocity_w", "acceleration_w", "jerk_w", "snap_w", "yaw_rate"):
        assert not path[field].any(), field
    for other in {"x", "y", "z", "yaw"} - {axis}:
        np.testing.assert_array_equal(along(path, other), along(path, other)[0])
    assert along(path, axis)[-1] == along(path, axis)[0] == pytest.approx(POINT[axis])


def test_progress_runs_from_0_to_1(bench: Bench) -> None:
    bench.excite(duration=1.0)
    bench.fly(1.25)
    assert bench.machine.progress == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"axis": "x", "amplitude": 0.7}, "0.7 m on x; allowed 0.6 m (behavior.excite_position"),
        ({"axis": "yaw", "amplitude": -0.9}, "0.9 rad on yaw; allowed 0.8 rad (behavior.excite_y"),
        ({"amplitude": 0.001}, "within the noise; allowed 0.01 to 0.6 m"),
        ({"duration": 9.0, "repeats": 4}, "it would take 72 s; allowed 40 s"),
        ({"axis": "roll"}, "axis = 'roll' is not one of x, y, z, yaw"),
        ({"shape": "chirp"}, "'chirp' is not one of step, doublet"),
        ({"speed": 1.0}, "no argument 'speed'"),
    ],
)
def test_what_is_too_much_is_refused_with_what_is_allowed(
    bench: Bench, arguments: Mapping[str, float | str], reason: str
) -> None:
    assert reason in bench.refusal(True, **arguments)


def test_a_step_out_of_the_flight_volume_is_refused(bench: Bench) -> None:
    bench.machine.parameters.volume_x_max = 0.6
    assert "x = 0.70 m is outside the flight volume" in bench.refusal(axis="x", amplitude=0.3)
    bench.excite(axis="x", amplitude=-0.3)


def test_a_step_that_these_gains_answer_with_too_much_is_refused(bench: Bench) -> None:
    gains = ControlParameters().model_copy(deep=True)
    bench.machine.control = gains
    gains.position.kp_xy, gains.position.kp_z = 20.0, 20.0
    reason = bench.refusal(axis="y", amplitude=0.5)
    assert "a tilt of 46°; allowed 35°" in reason
    assert "try an amplitude of 0.34 m" in reason
    assert "try an amplitude of 0.17 m" in bench.refusal(axis="y", shape="doublet", amplitude=0.5)
    bench.machine.parameters.trajectory_thrust_margin = 0.3
    reason = bench.refusal(axis="z", amplitude=0.5)
    assert "asks for 10.0 m/s²" in reason or "ask for 10.0 m/s²" in reason
    fits = float(reason.rsplit(" of ", 1)[1].split()[0])
    bench.excite(axis="z", amplitude=fits)


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("position_w", (0.6, -0.3, 1.2), "0.20 m off"),
        ("velocity_w", (0.0, 0.3, 0.0), "0.30 m/s"),
        ("angular_velocity_b", (0.0, 0.0, 0.5), "0.50 rad/s"),
        ("velocity_w", (0.0, np.nan, 0.0), "nan m/s"),
    ],
)
def test_only_from_rest(
    bench: Bench, field: str, value: tuple[float, float, float], reason: str
) -> None:
    bench.state[field] = value
    answer = bench.refusal()
    assert "not at rest" in answer
    assert reason in answer


def test_only_in_the_air_and_from_hover(bench: Bench) -> None:
    assert "not left the ground" in bench.refusal(airborne=False)
    bench.excite()
    with pytest.raises(RefusedError, match="excite is under way already"):
        bench.excite()
    bench.machine.request("brake", {}, bench.state, True, True)
    with pytest.raises(RefusedError, match="starts from hover"):
        bench.excite()


@pytest.mark.parametrize("name", ["hover", "brake", "land", "fly_to", "velocity"])
def test_whoever_flies_may_take_over_at_any_time(bench: Bench, name: str) -> None:
    bench.excite()
    bench.fly(1.0)
    bench.machine.request(name, {}, bench.state, True, True)
    assert bench.machine.name.name.lower() == name


@pytest.mark.parametrize(("axis", "sign"), [("x", 1), ("x", -1), ("y", -1), ("z", 1)])
def test_a_vehicle_that_leaves_the_path_is_braked_from_where_it_is(
    bench: Bench, axis: str, sign: int
) -> None:
    bench.excite(axis="x", amplitude=0.3)
    bench.fly(1.0)
    edge = (0.3 if axis == "x" and sign > 0 else 0.0) + 0.5
    place = np.array([POINT["x"], POINT["y"], POINT["z"]])
    place["xyz".index(axis)] += sign * (edge - 0.01)
    bench.move_to(place, POINT["yaw"])
    bench.fly(DT)
    assert bench.flies(BehaviorName.EXCITE)
    place["xyz".index(axis)] += sign * 0.02
    bench.move_to(place, POINT["yaw"] + 0.2)
    bench.state["velocity_w"] = (0.5, 0.0, 0.0)
    bench.fly(DT)
    assert bench.flies(BehaviorName.BRAKE)
    assert "too far off the path" in bench.machine.aborted
    assert f"{axis} = " in bench.machine.aborted
    np.testing.assert_allclose(bench.reference["position_w"][0], place)
    np.testing.assert_allclose(bench.reference["velocity_w"][0], (0.5, 0.0, 0.0))
    assert bench.reference["yaw"][0] == pytest.approx(POINT["yaw"] + 0.2)
    bench.fly(4.0)
    assert bench.machine.name is BehaviorName.HOVER
    assert not bench.reference["velocity_w"].any()


@pytest.mark.parametrize(("axis", "wall"), [("x", 0.7), ("z", 1.2)])
def test_an_overshoot_far_out_of_the_flight_volume_is_braked(axis: str, wall: float) -> None:
    bench = Bench(**{f"volume_{axis}_max": wall})
    bench.excite(axis="x", amplitude=0.3)
    bench.fly(1.0)
    place = np.array([POINT["x"], POINT["y"], POINT["z"]])
    for beyond, name in ((0.19, BehaviorName.EXCITE), (0.21, BehaviorName.BRAKE)):
        place["xyz".index(axis)] = wall + beyond
        bench.move_to(place, POINT["yaw"])
        bench.fly(DT)
        assert bench.machine.name is name
    assert "outside the flight volume" in bench.machine.aborted


def test_a_yaw_far_off_or_a_tilt_beyond_the_limit_ends_it(bench: Bench) -> None:
    bench.excite(axis="yaw", amplitude=0.5)
    bench.fly(1.0)
    bench.put(POINT["x"], POINT["y"], POINT["z"], POINT["yaw"] + 1.4)
    bench.fly(DT)
    assert "yaw is 1.40 rad off" in bench.machine.aborted
    bench = Bench()
    bench.excite()
    bench.state["quaternion_wb"] = (np.cos(0.45), np.sin(0.45), 0.0, 0.0)
    bench.fly(DT)
    assert "tilted beyond control.limits.tilt_max" in bench.machine.aborted


def test_a_lost_position_ends_it(bench: Bench) -> None:
    bench.excite()
    bench.state["position_w"] = np.nan
    bench.fly(DT)
    assert bench.machine.name is BehaviorName.BRAKE
    assert np.isfinite(bench.reference.view("f8")).all()


def test_the_largest_jump_of_a_doublet_is_twice_its_amplitude() -> None:
    point = (0.0, 0.0, 1.0, 0.0)
    made = {
        s: Multistep(point, axis="z", shape=s, amplitude=-0.3, duration=1.0)
        for s in ("step", "doublet")
    }
    assert made["step"].swing == pytest.approx(0.3)
    assert made["doublet"].swing == pytest.approx(0.6)
    assert made["step"].span == (-0.3, 0.0)
    assert made["doublet"].ends() == ((0.0, 0.0, 0.7), (0.0, 0.0, 1.3))
