"""The disturbance observer finds what the model lacks, and the law compensates it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from control.controller import GeometricController
from control.disturbance_observer import DISTURBANCE, DisturbanceObserver
from control.margins import margins
from control.near_hovering import NearHoveringController
from control.parameters import ControlParameters, DisturbanceParameters
from control.presets import preset
from control.trajectories.figure_eight import FigureEight
from control.trajectories.line import Hover
from quadrotor.records import ACTUATORS, Record, new_reference, new_state
from quadrotor.vehicle_model import GRAVITY, VehicleModel, reference_of_thrust
from tests.control.flight import Flight
from tests.support.arrays import Array

LAG = 0.047
DT = 0.002
MODEL = VehicleModel()
HOVER = MODEL.mass * GRAVITY


def settings(**changes: float) -> DisturbanceParameters:
    return DisturbanceParameters(force=True, torque=True, **changes)


class CommandPermission:
    """Level vehicle with the commanded thrust; the test sets velocity and angular velocity."""

    def __init__(self, parameters: DisturbanceParameters, law_mass: float = MODEL.mass) -> None:
        self.observer = DisturbanceObserver(parameters)
        self.model = MODEL.record()
        self.model["mass"] = law_mass
        self.state, self.actuators = new_state(), np.zeros(1, ACTUATORS)
        self.actuators["motor_references"] = reference_of_thrust(
            0.25 * HOVER, MODEL.motor_slope, MODEL.motor_offset
        )
        self.out = np.zeros(1, DISTURBANCE)

    def step(
        self,
        seconds: float,
        acceleration: npt.ArrayLike = (0, 0, 0),
        turn: npt.ArrayLike = (0, 0, 0),
        flying: bool = True,
        carried: bool = False,
    ) -> CommandPermission:
        for _ in range(round(seconds / DT)):
            self.state["velocity_w"] += DT * np.array(acceleration)
            self.state["angular_velocity_b"] += DT * np.array(turn)
            self.observer.step(
                self.state, self.actuators, self.model, flying, carried, DT, self.out
            )
        return self

    @property
    def force(self) -> Array:
        return np.array(self.out["force_w"][0])

    @property
    def torque(self) -> Array:
        return np.array(self.out["torque_b"][0])


def test_what_it_finds_is_the_disturbance_behind_its_low_pass() -> None:
    one = CommandPermission(settings(force_bandwidth=4.0, torque_bandwidth=2.0, fade=0.1))
    one.step(2.0)  # faded in, nothing found
    assert one.force == pytest.approx([0, 0, 0], abs=1e-9)
    push, turn = np.array([0.6, -0.4, 0.3]), np.array([0.5, -0.3, 0.2])
    one.step(0.4, push)
    reached = MODEL.mass * push * -math.expm1(-4.0 * 0.4)
    assert one.force == pytest.approx(reached, rel=0.01)
    one.step(3.0, push)
    assert one.force == pytest.approx(MODEL.mass * push, rel=1e-3)
    one.step(0.4, push, turn)
    J = np.array([MODEL.inertia_xx, MODEL.inertia_yy, MODEL.inertia_zz])
    twisted = J * turn * -math.expm1(-2.0 * 0.4)
    # One axis after the other, because three at once couple, which the model includes.
    assert one.torque == pytest.approx(twisted, rel=0.05)


def test_what_thrust_lacks_turns_with_the_vehicle_and_wind_does_not() -> None:
    lost, push_w, rate = 0.2 * HOVER, np.array([0.0, 0.8, 0.0]), 1.5
    late = rate / 14.0  # rad, what a low pass in world axes would be behind
    for is_lost in (True, False):
        one = CommandPermission(settings(fade=0.1))
        for k in range(500):  # about x, from -45 degrees
            angle = rate * (k + 1) * DT - 0.25 * math.pi
            half, back = 0.5 * angle, angle - 0.5 * rate * DT
            one.state["quaternion_wb"] = math.cos(half), math.sin(half), 0.0, 0.0
            one.state["angular_velocity_b"] = rate, 0.0, 0.0
            z_w = np.array([0.0, -math.sin(angle), math.cos(angle)])
            thrust_w = HOVER * np.array([0.0, -math.sin(back), math.cos(back)])
            acting_w = -lost / HOVER * thrust_w if is_lost else push_w
            one.step(DT, (thrust_w + acting_w) / MODEL.mass - (0.0, 0.0, GRAVITY))
        lift = float(one.out["lift"][0])
        if is_lost:
            assert lift == pytest.approx(-lost, rel=1e-3)
            assert one.force == pytest.approx(-lost * z_w, abs=0.02 * late * lost)
        else:
            assert lift == pytest.approx(push_w @ z_w, abs=late * 0.8)
            assert one.force == pytest.approx(push_w, abs=late * 0.8)


def test_the_force_has_its_rate_while_it_grows() -> None:
    one = CommandPermission(settings(force_bandwidth=10.0, fade=0.1)).step(0.5)
    grown = []
    for k in range(900):
        one.step(DT, (0.001 * k, 0.0, 0.0))
        rates = (float(one.out[name][0, 0]) for name in ("force_rate_w", "force_curve_w"))
        grown.append((one.force[0], *rates))
    forces, rates, curves = np.array(grown[-200:]).T
    assert rates == pytest.approx(np.gradient(forces, DT), rel=0.04)
    assert curves == pytest.approx(np.gradient(rates, DT), abs=0.01 * rates.max())


def test_bounds_hold_and_a_bounded_force_has_no_rate() -> None:
    one = CommandPermission(
        settings(force_max=0.5, torque_max=0.01, torque_bandwidth=5.0, fade=0.1)
    )
    one.step(1.0, (3.0, 0.0, -3.0))
    assert one.force == pytest.approx([0.5, 0.0, -0.5])
    assert one.out["lift"][0] == pytest.approx(-0.5)
    for rate in ("force_rate_w", "force_curve_w"):
        assert one.out[rate][0] == pytest.approx([0, 0, 0])
    one.step(1.0, turn=(5.0, 0.0, 0.0))
    assert one.torque[0] == pytest.approx(0.01)


def test_nothing_jumps_when_it_takes_off_is_switched_off_and_on_again() -> None:
    one = CommandPermission(settings(fade=1.0))
    one.step(1.0, flying=False)
    found = []

    def fly(seconds: float) -> None:
        for _ in range(round(seconds / DT)):
            found.append(one.step(DT, (1.0, 0.0, 0.0)).force[0])

    fly(3.0)
    assert found[-1] == pytest.approx(MODEL.mass, rel=1e-3)
    one.observer.configure(DisturbanceParameters())
    fly(4.5)
    assert found[-1] == 0.0
    assert one.observer.idle
    one.state["velocity_w"] = 0.0  # it was not observing: a new start
    one.observer.configure(settings(fade=1.0))
    fly(3.0)
    assert found[-1] == pytest.approx(MODEL.mass, rel=1e-3)
    assert np.abs(np.diff(found)).max() < 3.0 * MODEL.mass * DT


def test_on_the_ground_it_forgets_and_where_the_ground_carries_it_holds() -> None:
    one = CommandPermission(settings(fade=0.1)).step(1.0, (0.5, 0.0, 0.0))
    before = one.force
    one.step(1.0, (0.0, 0.0, 4.0), carried=True)
    assert one.force == pytest.approx(before, abs=1e-9)
    one.step(DT, (0.5, 0.0, 0.0))
    assert one.force == pytest.approx(before, abs=0.1)
    one.step(DT, flying=False)
    assert not one.force.any()
    assert not one.torque.any()


def test_a_state_that_is_no_number_leaves_what_was_found() -> None:
    one = CommandPermission(settings(fade=0.1)).step(1.0, (0.5, 0.0, 0.0))
    before = one.force
    one.state["velocity_w"][0, 0] = np.nan
    one.step(0.1)
    assert one.force == pytest.approx(before)


def test_drag_that_the_model_has_is_no_disturbance() -> None:
    one = CommandPermission(settings(fade=0.1))
    one.model["drag"] = 0.3
    one.state["velocity_w"] = (2.0, 0.0, 0.0)
    for _ in range(1000):
        speed = float(one.state["velocity_w"][0, 0])
        one.step(DT, (-0.3 * speed / MODEL.mass, 0.0, 0.0))
    assert one.force == pytest.approx([0, 0, 0], abs=0.01)


def test_the_mass_that_is_flown_on_leaves_the_rest_to_it() -> None:
    heavy = CommandPermission(settings(), law_mass=1.2 * MODEL.mass).step(3.0)
    # Hovering on less thrust than that mass needs: something must be lifting.
    assert heavy.force[2] == pytest.approx(0.2 * HOVER, rel=1e-3)
    assert CommandPermission(settings()).step(3.0).force[2] == pytest.approx(0.0, abs=1e-6)


# ---------------------------------------------------------------- in the loop
def observed(
    parameters: ControlParameters,
    true_mass: float = 1.308,
    force_w: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Flight:
    """Return a closed loop whose `advance` observes first, as the vehicle's tick does."""
    observer = DisturbanceObserver(parameters.disturbance)

    class Observed(Flight):
        def advance(self, dt: float = DT, airborne: bool = True, idle: bool = False) -> None:
            if not observer.idle:
                model, out = self.believed.record(), self.controller.disturbance
                observer.step(self.state, self.actuators, model, True, False, dt, out)
            super().advance(dt, airborne, idle)

    return Observed(parameters=parameters, true_mass=true_mass, force_w=force_w)


@pytest.mark.parametrize(
    ("true_mass", "force_w", "share"),
    [(1.308, (1.0, -0.5, 0.3), 0.01), (1.2 * 1.308, (0.0, 0.0, 0.0), 0.25)],
)
def test_on_the_8_it_takes_off_a_push_and_a_payload(
    true_mass: float, force_w: tuple[float, float, float], share: float
) -> None:
    errors = {}
    for name in ("standard", "observer"):
        one = observed(preset(name), true_mass, force_w)
        one.fly(Hover((0.0, 0.0, 0.0), 0.0), 3.0)
        flown = one.fly(FigureEight((0.0, 0.0, 0.0)), 16.0)[4000:]
        errors[name] = np.sqrt((flown**2).sum(axis=1).mean())
    if any(force_w):  # the law's integral has had the time for a constant one
        assert errors["observer"] < 0.003
    assert errors["observer"] < max(share * 0.05, 0.003) + 0.25 * errors["standard"]


def test_a_drag_that_acts_above_the_centre_is_fed_forward_as_a_torque() -> None:
    state, reference, out = new_state(), new_reference(), np.zeros(1, ACTUATORS)
    reference["velocity_w"] = state["velocity_w"] = (1.0, 0.5, 0.0)
    for law in (GeometricController, NearHoveringController):
        torques = []
        for lever in (0.0, 0.02):
            controller = law()
            controller.configure(
                ControlParameters(), VehicleModel(drag=0.4, drag_lever=lever).record()
            )
            controller.step(state, reference, True, DT, out)
            torques.append(out["wrench"][0, 1:].copy())
        assert torques[1] - torques[0] == pytest.approx([-0.004, 0.008, 0.0], abs=1e-9)


def test_drag_fed_forward_is_none_on_the_8() -> None:
    drag = 0.3

    class Dragged(Flight):
        def advance(self, dt: float = DT, airborne: bool = True, idle: bool = False) -> None:
            self.force_w = (-drag * self.x[3], -drag * self.x[4], -drag * self.x[5])
            super().advance(dt, airborne, idle)

    found = {}
    for believed in (0.0, drag):
        one = Dragged(believed=VehicleModel(drag=believed))
        errors = one.fly(FigureEight((0.0, 0.0, 0.0)), 12.0)[3000:]
        found[believed] = np.sqrt((errors**2).sum(axis=1).mean())
    assert found[0.0] > 0.02
    assert found[drag] < 0.1 * found[0.0]


@pytest.mark.parametrize("law", [GeometricController, NearHoveringController])
def test_both_laws_take_off_force_and_torque(
    law: type[GeometricController] | type[NearHoveringController],
) -> None:
    controller = law()
    controller.configure(ControlParameters(), MODEL.record())
    state, reference, out = new_state(), new_reference(), np.zeros(1, ACTUATORS)
    controller.step(state, reference, True, DT, out)
    before = out["wrench"][0].copy()
    controller.reset()
    controller.disturbance["force_w"] = (0.0, 0.0, 1.5)
    controller.disturbance["torque_b"] = (0.01, -0.02, 0.003)
    controller.step(state, reference, True, DT, out)
    assert out["wrench"][0] - before == pytest.approx([-1.5, -0.01, 0.02, -0.003], abs=1e-9)


# ---------------------------------------------------------------- margins
def test_the_gain_set_with_it_bears_as_much_delay_as_the_standard_one() -> None:
    before = {one.loop: one for one in margins(preset("standard"), LAG)}
    after = {one.loop: one for one in margins(preset("observer"), LAG)}
    for loop in ("position", "motors"):
        assert after[loop].delay >= before[loop].delay
        assert after[loop].phase > before[loop].phase - 2.0
    assert min(one.delay for one in after.values()) >= min(one.delay for one in before.values())


def test_without_it_the_estimate_loop_is_the_position_loop() -> None:
    for name in ("standard", "stiff"):  # without exact rates, which take it from the attitude
        found = {one.loop: one for one in margins(preset(name), LAG)}
        assert found["estimate"].phase == found["position"].phase


@pytest.mark.parametrize("more", [0.9, 1.15])
def test_the_motors_margin_is_where_a_delay_there_makes_it_swing(more: float) -> None:
    """Thrusts are late by less and by more than the margin of the motors' loop."""
    parameters = preset("observer")
    parameters.disturbance.torque_bandwidth = 5.0  # much of the margin is the observer's
    borne = {one.loop: one for one in margins(parameters, LAG)}["motors"].delay
    assert borne < 0.9 * {one.loop: one for one in margins(preset("standard"), LAG)}["motors"].delay
    late = round(more * borne / DT)

    one = Flight(parameters=parameters)
    observer = DisturbanceObserver(parameters.disturbance)
    commanded = one.actuators.copy()
    model = one.believed.record()
    hover = reference_of_thrust(0.25 * HOVER, MODEL.motor_slope, MODEL.motor_offset)
    waiting: list[Array] = [np.full((1, 4), hover)] * late
    commanded["motor_references"] = hover

    class Late(GeometricController):
        def step(
            self, state: Record, reference: Record, airborne: bool, dt: float, actuators: Record
        ) -> None:
            observer.step(state, commanded, model, True, False, dt, self.disturbance)
            super().step(state, reference, airborne, dt, commanded)
            waiting.append(commanded["motor_references"].copy())
            actuators[...] = commanded
            actuators["motor_references"] = waiting.pop(0)

    one.controller = Late()
    one.controller.configure(parameters, model)
    one.x[10] = 0.02
    errors = one.fly(Hover((0.0, 0.0, 0.0), 0.0), 12.0)
    early = np.abs(errors[1000:2000, 1]).max()
    end = np.abs(errors[-1000:, 1]).max()
    assert bool(end > early) is (more > 1.0)
