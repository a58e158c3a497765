"""Faults of the motors, and of the body's mass."""

from __future__ import annotations

import math

from bearing_sim.faults.fault import Memory
from bearing_sim.faults.schedule import Moment
from quadrotor.constants import MOTORS
from quadrotor.parameters import parameter
from vehicle.simulator.faults.truth import Truth, VehicleFault

_MOTOR = ("motor",)


class Fade(VehicleFault):
    """One motor has a share of its thrust; with `ramp` it fades, as of a worn bearing."""

    name = "motors.fade"
    source = "simulator.motor_gain_*; definition"
    of = _MOTOR

    motor: str = parameter("front", choices=MOTORS)
    """motor that is weak"""
    gain: float = parameter(0.7, ge=0.0, le=1.2, step=0.05)
    """its thrust over the usual"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        _weaken(truth, self.motor, 1.0 + moment.level * (self.gain - 1.0))


class Flicker(VehicleFault):
    """One motor loses and regains thrust periodically, as of a loose connector."""

    name = "motors.flicker"
    source = "square wave; assumed"
    of = _MOTOR
    varies = True

    motor: str = parameter("front", choices=MOTORS)
    """motor that flickers"""
    gain: float = parameter(0.5, ge=0.0, le=1.2, step=0.05)
    """its thrust over the usual, in the first half of each period"""
    rate: float = parameter(10.0, unit="Hz", ge=0.1, le=100, step=1)
    """periods a second"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        if moment.elapsed * self.rate % 1.0 < 0.5:
            _weaken(truth, self.motor, 1.0 + moment.level * (self.gain - 1.0))


class Imbalance(VehicleFault):
    """One rotor shakes the sensors at its own speed, as of a chipped propeller."""

    name = "motors.imbalance"
    source = "the force of an unbalanced mass grows with the speed squared (simulator.vibration)"
    of = _MOTOR

    motor: str = parameter("front", choices=MOTORS)
    """motor that shakes"""
    vibration: float = parameter(2.0, unit="m/s²", ge=0.0, le=20.0, step=0.1)
    """rms of its line on each axis of the accelerometer, at hover"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.shaking[MOTORS.index(self.motor)] += moment.level * self.vibration


class Centre(VehicleFault):
    """The centre of mass is not in the middle of the rotors, so that thrust turns the body."""

    name = "vehicle.centre"
    source = "torque -c x (0, 0, thrust); the feet and the sensors stay where they are"

    x: float = parameter(0.01, unit="m", ge=-0.1, le=0.1, step=0.005)
    """of the centre of mass along x_B"""
    y: float = parameter(0.0, unit="m", ge=-0.1, le=0.1, step=0.005)
    """of the centre of mass along y_B"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.centre_b = moment.level * self.x, moment.level * self.y


class Products(VehicleFault):
    """The inertia has entries off its diagonal, as of a battery mounted askew."""

    name = "vehicle.inertia"
    source = "Euler's equation with the whole inertia"

    xy: float = parameter(0.2, ge=-0.4, le=0.4, step=0.05)
    """entry xy over the root of the product of entries xx and yy"""
    xz: float = parameter(0.0, ge=-0.4, le=0.4, step=0.05)
    """entry xz over the root of the product of entries xx and zz"""
    yz: float = parameter(0.0, ge=-0.4, le=0.4, step=0.05)
    """entry yz over the root of the product of entries yy and zz"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        p = truth.parameters
        roots = [math.sqrt(one) for one in (p.inertia_xx, p.inertia_yy, p.inertia_zz)]
        truth.products_b = (
            moment.level * self.xy * roots[0] * roots[1],
            moment.level * self.xz * roots[0] * roots[2],
            moment.level * self.yz * roots[1] * roots[2],
        )


class SlungLoad(VehicleFault):
    """A point mass hangs on an elastic cable from the body's origin; a slack cable pulls not."""

    name = "vehicle.slung_load"
    source = (
        "K. Sreenath, T. Lee, V. Kumar, Geometric control and differential flatness of a quadrotor "
        "UAV with a cable-suspended load, CDC 2013; the cable is elastic here"
    )

    mass: float = parameter(0.1, unit="kg", ge=0.01, le=1.0, step=0.01)
    """mass of the load"""
    length: float = parameter(0.5, unit="m", ge=0.05, le=5.0, step=0.05)
    """length of the cable"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.load = max(1e-6, moment.level * self.mass), self.length


def _weaken(truth: Truth, motor: str, gain: float) -> None:
    name = f"motor_gain_{motor}"
    setattr(truth.parameters, name, gain * getattr(truth.parameters, name))


BODY: tuple[type[VehicleFault], ...] = (*(Fade, Flicker, Imbalance, Centre, Products, SlungLoad),)
