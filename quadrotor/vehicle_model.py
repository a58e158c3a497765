"""The vehicle: mixing matrix of eq. 1, affine motor law, limits.

Default values are those of the paper's MK-Quadro (Secs. 2, 5.3); the inertia is not printed there
and is a reasonable value for that frame (docs/deviations.md).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.constants import GRAVITY as GRAVITY  # noqa: PLC0414 - re-exported
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Record

Array = npt.NDArray[np.float64]
Four = tuple[float, float, float, float]
"""A wrench (thrust in N; torques about body x, y, z in N m), or one number for each motor."""

MODEL = np.dtype(
    [
        ("mass", "f8"),  # kg
        ("inertia_b", "f8", 3),  # kg m^2, diagonal
        ("arm", "f8"),  # m
        ("torque_ratio", "f8"),  # m, c of eq. 1
        ("motor_time_constant", "f8"),  # s
        ("motor_slope", "f8"),  # sqrt(N) per count
        ("motor_offset", "f8"),  # counts
        ("thrust_min", "f8"),  # N per motor
        ("thrust_max", "f8"),  # N per motor
        ("drag", "f8"),  # N s/m
        ("drag_lever", "f8"),  # m, above the centre of mass
    ],
    align=True,
)


class VehicleModel(Parameters):
    """The controller's model of the vehicle."""

    mass: float = parameter(1.308, unit="kg", ge=0.02, le=2.4, step=0.001, flight_step=0.2)
    """total mass"""
    inertia_xx: float = parameter(
        0.0154, unit="kg m²", ge=1e-06, le=0.1, step=1e-07, flight_step=0.005
    )
    """inertia about body x"""
    inertia_yy: float = parameter(
        0.0154, unit="kg m²", ge=1e-06, le=0.1, step=1e-07, flight_step=0.005
    )
    """inertia about body y"""
    inertia_zz: float = parameter(
        0.025, unit="kg m²", ge=1e-06, le=0.2, step=1e-07, flight_step=0.01
    )
    """inertia about body z"""
    arm: float = parameter(0.25, unit="m", ge=0.03, le=1.0, step=0.001, flight_step=0.05)
    """rotor axis to centre, l of eq. 1"""
    torque_ratio: float = parameter(
        0.0174, unit="m", ge=0.001, le=0.1, step=0.0001, flight_step=0.004
    )
    """torque per thrust, c of eq. 1"""
    motor_time_constant: float = parameter(0.047, unit="s", ge=0.001, le=0.5, step=0.001)
    """first-order lag of rotor speed"""
    drag: float = parameter(0.0, unit="N s/m", ge=0.0, le=2.0, step=0.01, flight_step=0.2)
    """linear drag, fed forward by the reference's velocity; 0: none. The experiment `drag` finds
    it"""
    drag_lever: float = parameter(0.0, unit="m", ge=-0.1, le=0.3, step=0.001, flight_step=0.05)
    """height over the centre of mass at which the drag acts; its torque lifts the leading side, as
    flapping blades do. The experiment `drag` finds it"""
    motor_slope: float = parameter(
        0.0126403, unit="√N", ge=0.001, le=0.1, step=1e-07, flight_step=0.001
    )
    """√thrust per reference count"""
    motor_offset: float = parameter(14.267, unit="count", ge=-50, le=50, step=0.01, flight_step=5.0)
    """offset of the affine motor law"""
    battery_nominal: float = parameter(15.2, unit="V", ge=3.0, le=30.0, step=0.1, flight_step=1.0)
    """battery voltage of the motor law"""
    battery_exponent: float = parameter(0.0, ge=0.0, le=1.5, step=0.05, flight_step=0.25)
    """rotor speed follows voltage to this power; 0: not compensated"""
    motor_reference_min: float = parameter(
        30.0, unit="count", ge=0, le=100, step=1, flight_step=20.0
    )
    """smallest reference in flight"""
    motor_reference_max: float = parameter(
        180.0, unit="count", ge=100, le=255, step=1, flight_step=20.0
    )
    """largest reference in flight"""

    def record(self, voltage: float | None = None) -> Record:
        """Return the model as one MODEL record, shape (1,).

        Args:
            voltage: V, of the battery; None for the nominal one. Speed is affine in the reference
                at any voltage, so only the slope and the thrust limits depend on it.
        """
        slope = self.motor_slope
        if voltage is not None:
            slope *= self.battery_gain(voltage)
        out = np.zeros(1, MODEL)
        out["mass"] = self.mass
        out["inertia_b"] = (self.inertia_xx, self.inertia_yy, self.inertia_zz)
        out["arm"] = self.arm
        out["torque_ratio"] = self.torque_ratio
        out["motor_time_constant"] = self.motor_time_constant
        out["motor_slope"] = slope
        out["motor_offset"] = self.motor_offset
        out["drag"] = self.drag
        out["drag_lever"] = self.drag_lever
        out["thrust_min"] = thrust_of_reference(self.motor_reference_min, slope, self.motor_offset)
        out["thrust_max"] = thrust_of_reference(self.motor_reference_max, slope, self.motor_offset)
        return out

    def battery_gain(self, voltage: float) -> float:
        """Return rotor speed at `voltage` (V) over that at the nominal one, for the same reference.

        A voltage outside half to one and a half times the nominal is a faulty reading and is
        clamped.
        """
        share = min(1.5, max(0.5, voltage / self.battery_nominal))
        return float(share**self.battery_exponent)


def mixing_matrix(arm: float, torque_ratio: float) -> Array:
    """Return M of eq. 1, shape (4, 4): from thrusts (N) of motors front, left, rear, right to the
    wrench.

    The wrench is (total thrust in N; torques about body x, y, z in N m).
    """
    l, c = arm, torque_ratio  # noqa: E741 - the paper's symbol
    return np.array([[1, 1, 1, 1], [0, l, 0, -l], [-l, 0, l, 0], [c, -c, c, -c]], dtype=float)


@compiled(inner=True)
def wrench_of_thrusts(thrusts: Four, arm: float, torque_ratio: float) -> Four:
    """Return u = M f, eq. 1."""
    a, b, c, d = thrusts[0], thrusts[1], thrusts[2], thrusts[3]
    return a + b + c + d, arm * (b - d), arm * (c - a), torque_ratio * (a - b + c - d)


@compiled(inner=True)
def thrusts_of_wrench(wrench: Four, arm: float, torque_ratio: float) -> Four:
    """Return f = M^-1 u: M M^T is diagonal, so the inverse is M^T diag(1/4, 1/2l^2, 1/2l^2,
    1/4c^2).
    """
    a = 0.25 * wrench[0]
    roll = 0.5 * wrench[1] / arm
    pitch = 0.5 * wrench[2] / arm
    yaw = 0.25 * wrench[3] / torque_ratio
    return a - pitch + yaw, a + roll - yaw, a + pitch + yaw, a - roll - yaw


@compiled
def thrust_of_reference(reference: float, slope: float, offset: float) -> float:
    """Return the steady thrust (N) of a motor reference (counts), f = (slope (ref + offset))^2.

    The paper's two printed forces fit only a law affine in speed (docs/deviations.md).
    """
    root = slope * (reference + offset)
    return root * root if root > 0.0 else 0.0


@compiled
def reference_of_thrust(thrust: float, slope: float, offset: float) -> float:
    """Return the motor reference (counts, >= 0) of a thrust (N); the law's zero up to 0 N."""
    return max(0.0, math.sqrt(max(0.0, thrust)) / slope - offset)
