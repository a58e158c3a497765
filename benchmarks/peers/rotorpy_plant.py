"""The laws' vehicle by RotorPy's equations of motion (Folk, Paulos, Kumar 2023)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from control.controller import GeometricController
from control.disturbance_observer import DisturbanceObserver
from control.laws import extended, settings_of
from control.parameters import GEOMETRIC, ControlParameters, control_record
from control.trajectories.trajectory import Trajectory
from quadrotor.records import ACTUATORS, Array, Record, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel

PERIOD = 0.002
"""s, of a tick."""
HOVER = 3.0
"""s of hover before the course, which are not judged."""
FAR = 2.0
"""m from the reference: a crash, as in the arena."""
THRUST_FACTOR = 1.6e-5
"""N s²/rad², thrust over the square of a rotor's speed: with it a rotor hovers at 448 rad/s, about
as fast as those of the Hummingbird, whose aerodynamics are taken."""
AERODYNAMIC = ("c_Dx", "c_Dy", "c_Dz", "k_d", "k_z", "k_h", "k_flap", "rotor_radius")
Step = Callable[[Record, Record, Record], None]
"""Function of STATE, REFERENCE and ACTUATORS, which makes one tick of a law."""


class RotorPyPlant:
    """The vehicle of quadlab in RotorPy, with the aerodynamics of its Hummingbird.

    The speed of a rotor follows its command with one time constant; rotors are dragged, lift more
    in translation and less in a climb; the body has quadratic drag. Raises ImportError when RotorPy
    is not installed.

    Args:
        model: the vehicle as the laws know it. payload: kg, at the centre. wind_x: m/s.
        mirrored: whether each rotor turns the other way.
    """

    def __init__(
        self,
        model: VehicleModel,
        *,
        payload: float = 0.0,
        wind_x: float = 0.0,
        mirrored: bool = False,
    ) -> None:
        from rotorpy.vehicles.hummingbird_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor

        arm = model.arm
        places = ((arm, 0.0), (0.0, arm), (-arm, 0.0), (0.0, -arm))
        slowest, fastest = (math.sqrt(one / THRUST_FACTOR) for one in ends_of(model))
        values = {
            "mass": model.mass + payload,
            **{f"I{axis}": getattr(model, f"inertia_{axis}") for axis in ("xx", "yy", "zz")},
            **dict.fromkeys(("Ixy", "Ixz", "Iyz"), 0.0),
            "num_rotors": 4,
            "rotor_pos": {f"r{k}": np.array([x, y, 0.0]) for k, (x, y) in enumerate(places)},
            "rotor_directions": np.array([1, -1, 1, -1]) * (-1 if mirrored else 1),
            "k_eta": THRUST_FACTOR,
            "k_m": THRUST_FACTOR * model.torque_ratio,
            "tau_m": model.motor_time_constant,
            "rotor_speed_min": slowest,
            "rotor_speed_max": fastest,
            **{name: quad_params[name] for name in AERODYNAMIC},
        }
        self._vehicle = Multirotor(values)
        self._wind = np.array([wind_x, 0.0, 0.0])

    def fly(self, step: Step, course: Trajectory, seconds: float) -> float:
        """Return the rms position error (m) of a course from its first s on; NaN for a crash."""
        state, reference, actuators = new_state(), new_reference(), np.zeros(1, ACTUATORS)
        course.sample(0.0, reference)
        hover = math.sqrt(self._vehicle.mass * 9.81 / 4.0 / THRUST_FACTOR)
        now = {
            "x": reference["position_w"][0].copy(),
            "v": np.zeros(3),
            "q": _scalar_last(reference["yaw"][0]),
            "w": np.zeros(3),
            "wind": self._wind,
            "rotor_speeds": np.full(4, hover),
        }
        squares = []
        for k in range(round((HOVER + seconds) / PERIOD)):
            t = k * PERIOD - HOVER
            course.sample(max(0.0, t), reference)
            state["position_w"], state["velocity_w"] = now["x"], now["v"]
            state["quaternion_wb"] = np.roll(now["q"], 1)
            state["angular_velocity_b"] = now["w"]
            error = now["x"] - reference["position_w"][0]
            if not np.linalg.norm(error) <= FAR:
                return math.nan
            if t >= 0.0:
                squares.append(float(error @ error))
            step(state, reference, actuators)
            speeds = np.sqrt(actuators["thrusts"][0] / THRUST_FACTOR)
            now = self._vehicle.step(now, {"cmd_motor_speeds": speeds}, PERIOD)
            now["wind"] = self._wind
        return math.sqrt(sum(squares) / len(squares))


def _scalar_last(yaw: float) -> Array:
    return np.array([0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)])


def ends_of(model: VehicleModel) -> tuple[float, float]:
    """Return the least and the largest thrust of a rotor, N."""
    record = model.record()
    return float(record["thrust_min"][0]), float(record["thrust_max"][0])


def law_of(control: ControlParameters, model: VehicleModel) -> Step:
    """Return the law that the parameters choose, in flight."""
    record, name = model.record(), control.law
    if name != GEOMETRIC:
        law = extended()[name].load()
        own, gains = (law.new_memory(), settings_of(control, name)), control_record(control)

        def extended_law(state: Record, reference: Record, actuators: Record) -> None:
            law.step(own, (state, reference, gains, record, actuators), True, True, PERIOD)

        return extended_law
    controller, observer = GeometricController(), DisturbanceObserver(control.disturbance)
    controller.configure(control, record)

    def geometric(state: Record, reference: Record, actuators: Record) -> None:
        if not observer.idle:
            found = controller.disturbance
            observer.step(state, actuators, record, True, False, PERIOD, found)
        controller.step(state, reference, True, PERIOD, actuators)

    return geometric
