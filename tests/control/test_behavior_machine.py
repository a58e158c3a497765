"""Behavior machine: what flies, what is refused, and that the reference never jumps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from control.behaviors.behavior import argument_descriptions
from control.behaviors.machine import BEHAVIORS, BehaviorMachine
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from quadrotor.errors import OutOfBoundsError, RefusedError, UnknownParameterError, WrongTypeError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record, new_reference, new_state, new_tick
from tests.support.arrays import Array

DT = 0.002
WEIGHT = 1.308 * 9.81


class Bench:
    """Machine whose vehicle is exactly at the reference."""

    def __init__(self, **changes: Any) -> None:
        self.machine = BehaviorMachine(BehaviorParameters(**changes), WEIGHT)
        self.state, self.reference = new_state(), new_reference()
        self.stamp_ns = 0
        self.joy: tuple[int, Sequence[float], bool] | None = None

    def request(
        self, name: str, armed: bool = True, airborne: bool = True, **arguments: ParameterValue
    ) -> None:
        self.ask(name, arguments, armed, airborne)

    def ask(
        self,
        name: str,
        arguments: Mapping[str, ParameterValue],
        armed: bool = True,
        airborne: bool = True,
    ) -> None:
        self.machine.request(name, arguments, self.state, armed, airborne)

    def run(self, seconds: float, dt: float = DT) -> Record:
        """Return all references of this time, (N,)."""
        out = []
        for _ in range(round(seconds / dt)):
            self.stamp_ns += round(dt * 1e9)
            self.machine.step(self.stamp_ns, dt, self.state, self.joy, WEIGHT, self.reference)
            self.state["position_w"] = self.reference["position_w"]
            self.state["velocity_w"] = self.reference["velocity_w"]
            out.append(self.reference.copy())
        return np.concatenate(out)

    def hover(self) -> Bench:
        self.request("take_off", height=1.0)
        self.run(6.0)
        assert self.machine.name is BehaviorName.HOVER
        return self

    def flies(self, name: BehaviorName) -> bool:
        return self.machine.name is name

    def sticks(self, *axes: float, enabled: bool = True, age_ns: int = 0) -> None:
        self.joy = (self.stamp_ns - age_ns, axes, enabled)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def hovering() -> Bench:
    return Bench().hover()


def position(bench: Bench) -> Array:
    return np.array(bench.reference["position_w"][0])


def test_on_the_ground_the_reference_is_the_state(bench: Bench) -> None:
    bench.state["position_w"] = (1.0, -2.0, 0.05)
    bench.state["quaternion_wb"] = [np.cos(0.3), 0, 0, np.sin(0.3)]
    bench.run(DT)
    assert bench.machine.name is BehaviorName.GROUND
    np.testing.assert_allclose(position(bench), [1.0, -2.0, 0.05])
    assert bench.reference["yaw"][0] == pytest.approx(0.6)


def test_take_off_climbs_from_where_the_vehicle_stands_and_becomes_hover(bench: Bench) -> None:
    bench.state["position_w"] = (1.0, -2.0, 0.05)
    bench.request("take_off", height=1.5, speed=0.5)
    assert bench.flies(BehaviorName.TAKE_OFF)
    path = bench.run(6.0)
    assert bench.flies(BehaviorName.HOVER)
    np.testing.assert_allclose(position(bench), [1.0, -2.0, 1.55])
    assert path["position_w"][0, 2] == pytest.approx(0.05, abs=1e-6)
    assert np.diff(path["position_w"][:, 2]).min() >= 0.0
    assert path["velocity_w"][:, 2].max() == pytest.approx(0.5)
    assert np.abs(path["acceleration_w"]).max() <= 1.5 + 1e-9


def test_default_speeds_come_from_the_parameters(bench: Bench) -> None:
    bench.machine.parameters.take_off_speed = 0.2
    bench.request("take_off")
    assert bench.run(8.0)["velocity_w"][:, 2].max() == pytest.approx(0.2)


def test_fly_to_goes_there_and_keeps_what_was_left_out(hovering: Bench) -> None:
    hovering.request("fly_to", x=1.0, yaw=1.0)
    path = hovering.run(6.0)
    assert hovering.machine.name is BehaviorName.HOVER
    np.testing.assert_allclose(position(hovering), [1.0, 0.0, 1.0], atol=1e-9)
    assert hovering.reference["yaw"][0] == pytest.approx(1.0)
    assert np.linalg.norm(path["velocity_w"], axis=1).max() <= 0.8 + 1e-9


def test_fly_to_again_on_the_way_bends_the_path(hovering: Bench) -> None:
    hovering.request("fly_to", x=2.0)
    hovering.run(1.5)
    assert hovering.reference["velocity_w"][0, 0] > 0.3
    hovering.request("fly_to", x=0.0, y=1.0)
    hovering.run(8.0)
    assert hovering.machine.name is BehaviorName.HOVER
    np.testing.assert_allclose(position(hovering), [0.0, 1.0, 1.0], atol=1e-9)


def test_follow_trajectory_flies_laps_about_the_hover_point_and_progresses(hovering: Bench) -> None:
    hovering.request("follow_trajectory", laps=2)
    path = hovering.run(9.5)
    assert hovering.machine.progress == pytest.approx(0.5, abs=0.01)
    path = np.concatenate([path, hovering.run(10.0)])
    assert hovering.machine.name is BehaviorName.HOVER
    assert hovering.machine.progress == 0.0
    assert np.ptp(path["position_w"][:, 0]) == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(position(hovering), [0.0, 0.0, 1.0], atol=1e-9)


def test_brake_and_hover_in_motion_come_to_rest_nearby(hovering: Bench) -> None:
    for name in ("brake", "hover"):
        hovering.request("fly_to", x=2.0 if name == "brake" else -2.0)
        hovering.run(1.5)
        before = position(hovering)
        hovering.request(name)
        assert hovering.flies(BehaviorName.BRAKE)
        hovering.run(3.0)
        assert hovering.flies(BehaviorName.HOVER)
        assert np.linalg.norm(position(hovering) - before) < 0.7
        assert not hovering.reference["velocity_w"].any()


def test_a_repeated_hover_or_land_is_no_failure(hovering: Bench) -> None:
    hovering.request("hover")
    hovering.request("hover")
    assert hovering.machine.name is BehaviorName.HOVER
    hovering.request("land")
    hovering.run(1.0)
    hovering.request("land", speed=0.2)
    hovering.run(2.0)
    assert hovering.reference["velocity_w"][0, 2] == pytest.approx(-0.2, abs=1e-3)


def test_sticks_move_the_vehicle_in_its_own_yaw_frame(hovering: Bench) -> None:
    hovering.request("fly_to", yaw=np.pi / 2)
    hovering.run(4.0)
    hovering.request("velocity")
    for _ in range(100):
        hovering.sticks(1.0, 0.0, 0.0, 0.0)
        hovering.run(0.02)
    v = hovering.reference["velocity_w"][0]
    np.testing.assert_allclose(v, [0.0, 1.0, 0.0], atol=1e-3)


@pytest.mark.parametrize("case", ["released", "stale", "from the future", "missing", "nan"])
def test_sticks_that_do_not_count_stop_the_vehicle(hovering: Bench, case: str) -> None:
    hovering.request("velocity")
    for _ in range(30):
        hovering.sticks(1.0, 0.5, 0.2, 0.3)
        hovering.run(0.02)
    assert np.linalg.norm(hovering.reference["velocity_w"]) > 0.3
    for _ in range(150):
        hovering.sticks(1.0, 0.5, 0.2, 0.3, enabled=case != "released")
        if case == "stale":
            hovering.sticks(1.0, 0.5, 0.2, 0.3, age_ns=201_000_000)
        elif case == "from the future":
            hovering.sticks(1.0, 0.5, 0.2, 0.3, age_ns=-300_000_000)
        elif case == "missing":
            hovering.joy = None
        elif case == "nan":
            hovering.sticks(np.nan, np.inf, -np.inf, np.nan)
        hovering.run(0.02)
    np.testing.assert_allclose(hovering.reference["velocity_w"], 0.0, atol=1e-3)
    assert abs(hovering.reference["yaw_rate"][0]) < 1e-3
    assert hovering.machine.name is BehaviorName.VELOCITY


def test_sticks_older_than_200_ms_stop_the_vehicle_without_new_ones(hovering: Bench) -> None:
    hovering.request("velocity")
    hovering.sticks(1.0, 0.0, 0.0, 0.0)
    path = hovering.run(2.0)["velocity_w"][:, 0]
    assert 0.1 < path.max() < 0.6
    assert abs(path[-1]) < 1e-3


def test_axes_beyond_one_count_as_one_and_walls_hold(hovering: Bench) -> None:
    hovering.request("velocity")
    top = 0.0
    for _ in range(400):
        hovering.sticks(50.0, 0.0, 50.0, 0.0)
        top = max(top, np.abs(hovering.run(0.02)["velocity_w"]).max())
    assert top <= 1.0 + 1e-6
    assert 2.9 < position(hovering)[0] < 3.02
    assert 2.9 < position(hovering)[2] < 3.02


@pytest.mark.parametrize(
    ("name", "arguments", "text"),
    [
        ("fly_to", {"z": 4.5}, "z = 4.50 m is outside the flight volume; allowed 0.2 to 3 m"),
        ("fly_to", {"x": -3.2}, "x = -3.20 m is outside .* -3 to 3 m .*behavior.volume_x_min"),
        ("follow_trajectory", {"width": 8.0, "period": 20.0}, r"x = -?4.00 m is outside"),
        ("follow_trajectory", {"z_amplitude": 0.9}, "z = 0.10 m is outside"),
        ("follow_trajectory", {"period": 3.0}, "acceleration reaches .* try a period of"),
        ("follow_trajectory", {"yaw_amplitude": 3.0}, "yaw rate reaches .* rad/s"),
    ],
)
def test_what_leaves_the_volume_or_asks_too_much_is_refused_with_numbers(
    hovering: Bench, name: str, arguments: dict[str, float], text: str
) -> None:
    with pytest.raises(RefusedError, match=text):
        hovering.ask(name, arguments)
    assert hovering.machine.name is BehaviorName.HOVER


def test_the_period_a_refusal_proposes_is_accepted(hovering: Bench) -> None:
    arguments = {"yaw_amplitude": 0.2, "period": 3.0}
    for _ in range(3):
        try:
            hovering.ask("follow_trajectory", arguments)
            break
        except RefusedError as error:
            arguments["period"] = float(str(error).split("period of ")[1].split()[0])
    assert hovering.machine.name is BehaviorName.FOLLOW_TRAJECTORY


def test_take_off_beyond_the_ceiling_is_refused(bench: Bench) -> None:
    with pytest.raises(RefusedError, match=r"take_off refused: the end at z = 5\.00 m"):
        bench.request("take_off", height=5.0)
    assert bench.machine.name is BehaviorName.GROUND


@pytest.mark.parametrize(
    ("name", "arguments", "error", "text"),
    [
        ("take_off", {"heigth": 1.0}, UnknownParameterError, "takes height, speed"),
        ("take_off", {"height": float("nan")}, OutOfBoundsError, "not a finite number"),
        ("take_off", {"height": "high"}, WrongTypeError, "must be a number"),
        ("take_off", {"height": 0.01}, OutOfBoundsError, "allowed 0.2 to 20 m"),
        ("take_off", {"height": True}, WrongTypeError, "must be a number"),
    ],
)
def test_bad_arguments_give_the_standard_errors(
    bench: Bench,
    name: str,
    arguments: Mapping[str, ParameterValue],
    error: type[Exception],
    text: str,
) -> None:
    with pytest.raises(error, match=text):
        bench.ask(name, arguments)
    assert bench.machine.name is BehaviorName.GROUND


@pytest.mark.parametrize(
    ("name", "arguments", "error"),
    [
        ("brake", {"speed": 1.0}, UnknownParameterError),
        ("follow_trajectory", {"trajectory": "spiral"}, OutOfBoundsError),
        ("follow_trajectory", {"laps": 1.5}, WrongTypeError),
        ("follow_trajectory", {"laps": 1, "period": 4.0, "ramp": 5.0}, OutOfBoundsError),
        ("fly_to", {"x": float("inf")}, OutOfBoundsError),
    ],
)
def test_bad_arguments_in_flight_change_nothing(
    hovering: Bench, name: str, arguments: Mapping[str, float | str], error: type[Exception]
) -> None:
    before = position(hovering)
    with pytest.raises(error):
        hovering.ask(name, arguments)
    hovering.run(0.1)
    assert hovering.machine.name is BehaviorName.HOVER
    np.testing.assert_array_equal(position(hovering), before)


def test_take_off_without_a_pose_or_without_arming_is_refused(bench: Bench) -> None:
    with pytest.raises(RefusedError, match="arm the vehicle first"):
        bench.request("take_off", armed=False)
    bench.state["position_w"][0, 1] = np.nan
    with pytest.raises(RefusedError, match="does not know where it is"):
        bench.request("take_off")


@pytest.mark.parametrize("dt", [DT, 1 / 60])
def test_no_change_of_behavior_makes_the_reference_jump(
    rng: np.random.Generator, dt: float
) -> None:
    names = ["hover", "fly_to", "follow_trajectory", "velocity", "brake", "land"]
    bench = Bench().hover()
    last, done = bench.reference.copy(), set()
    for _ in range(40):
        name = str(rng.choice(names))
        arguments = {}
        if name == "fly_to":
            arguments = {"x": rng.uniform(-2, 2), "y": rng.uniform(-2, 2), "z": rng.uniform(1, 2)}
        try:
            bench.ask(name, arguments)
            done.add(name)
        except RefusedError:
            continue
        for _ in range(rng.integers(1, 8)):
            bench.sticks(*rng.uniform(-1, 1, size=4))
            path = np.concatenate([last, bench.run(rng.uniform(0.05, 0.5), dt)])
            for low, bound in (
                ("position_w", 2.6),  # m/s
                ("velocity_w", 4.5),  # m/s^2
                ("acceleration_w", 60.0),  # m/s^3
                ("jerk_w", 2000.0),  # m/s^4
                ("yaw", 1.6),
                ("yaw_rate", 3.0),
            ):
                rate = np.abs(np.diff(path[low], axis=0)).max() / dt
                assert rate < bound, (name, low, rate)
            last = path[-1:]
        if bench.machine.name is BehaviorName.LAND:
            bench.request("hover")
            bench.run(2.0)
            bench.request("fly_to", x=0.0, y=0.0, z=1.0)
            bench.run(8.0)
            last = bench.reference.copy()
    assert {"fly_to", "velocity", "brake", "land"} <= done


def test_each_requestable_behavior_describes_its_arguments() -> None:
    assert set(BEHAVIORS) == set(BehaviorName) - {BehaviorName.GROUND}
    take_off = BEHAVIORS[BehaviorName.TAKE_OFF]
    assert [*argument_descriptions(take_off.arguments)] == ["height", "speed"]
    assert argument_descriptions(BEHAVIORS[BehaviorName.BRAKE].arguments) == {}
    for behavior in BEHAVIORS.values():
        for d in argument_descriptions(behavior.arguments).values():
            assert d.description
            assert d.type in ("str", "bool") or (d.minimum is not None and d.maximum is not None)


def test_the_reference_may_live_inside_a_tick_record() -> None:
    bench = Bench()
    tick = new_tick()
    bench.reference = tick["reference"]
    bench.hover()
    assert tick["reference"]["position_w"][0, 2] == pytest.approx(1.0)
    wrong = np.zeros(3, tick["reference"].dtype)
    with pytest.raises(ValueError, match=r"shape \(1,\)"):
        bench.machine.step(0, DT, bench.state, None, 0.0, wrong)


def test_reset_returns_to_the_ground_at_once(hovering: Bench) -> None:
    hovering.machine.reset()
    assert hovering.machine.name is BehaviorName.GROUND
