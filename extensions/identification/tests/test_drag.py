"""Experiment `drag`: the coefficient from circles, whatever else is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from console.evaluation.log_columns import FlownParameters
from extensions.identification.drag.evaluation import PIECES, RAMP, estimate_drag
from extensions.identification.drag.optimal import quickest
from quadrotor.errors import MeasurementError
from quadrotor.vehicle_model import GRAVITY
from tests.support.arrays import Array

LAG, MASS, DT = 0.047, 1.308, 0.002
ARM, LEVER = 0.25, 0.03
PARAMETERS = FlownParameters(
    {
        "model.mass": MASS,
        "model.motor_time_constant": LAG,
        "model.drag": 0.0,
        "model.arm": ARM,
        "model.inertia_xx": 0.0154,
        "model.inertia_yy": 0.0154,
    },
    {"drag": 0.3},
)


def circled(
    drag: float, mass: float, speed: float = 1.0, seconds: float = 25.0
) -> tuple[Array, Array, Array, Array, Array]:
    """Return ticks of a circle of radius 0.8 m, with the tilt that drag and a push require.

    The vehicle is level about its axes, so that the torques are those against the drag's lever and
    a weak motor.
    """
    time = np.arange(0.0, seconds, DT)
    turn = speed / 0.8
    angle = turn * time
    velocity_w = np.stack([-np.sin(angle), np.cos(angle), 0.0 * time], axis=1) * speed
    pull = -speed * turn * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    force = np.empty((len(time), 3))
    force[:, :2] = mass * pull + drag * velocity_w[:, :2] + [0.3, -0.2]
    force[:, 2] = mass * GRAVITY
    thrust = np.linalg.norm(force, axis=1)
    thrusts = np.repeat(0.25 * thrust[:, None], 4, axis=1)
    torque = -LEVER * drag * np.stack([velocity_w[:, 1], -velocity_w[:, 0]], axis=1) + 0.02
    thrusts[:, 1::2] += 0.5 / ARM * torque[:, :1] * [1.0, -1.0]
    thrusts[:, ::2] += 0.5 / ARM * torque[:, 1:] * [-1.0, 1.0]
    motion_b = np.hstack((velocity_w[:, :2], np.zeros((len(time), 2))))
    return time, velocity_w, force / thrust[:, None], motion_b, thrusts


@pytest.mark.parametrize("mass", [MASS, 1.2 * MASS])
def test_a_wrong_mass_and_a_steady_push_do_not_look_like_drag(mass: float) -> None:
    flight = estimate_drag(*circled(0.3, mass), RAMP, PARAMETERS)
    assert flight.found == pytest.approx(0.3, abs=0.003)
    assert flight.constant_w == pytest.approx([-0.3, 0.2], abs=0.02)
    record = flight.record()
    assert record.values == {
        "model.drag": pytest.approx(0.3, abs=0.003),
        "model.drag_lever": pytest.approx(LEVER, abs=0.001),
    }
    assert record.good
    assert len(record.residuals) == PIECES


def test_what_shows_nothing_is_refused() -> None:
    slow = circled(0.3, MASS, speed=0.2)
    with pytest.raises(MeasurementError, match="too slow"):
        estimate_drag(*slow, RAMP, PARAMETERS)
    with pytest.raises(MeasurementError, match="outside what the model accepts"):
        estimate_drag(*circled(-0.2, MASS), RAMP, PARAMETERS).record()


def test_the_quickest_circles_are_bounded_by_room_acceleration_tilt_and_speed() -> None:
    limits = {
        "behavior.trajectory_acceleration_max": 4.0,
        "behavior.trajectory_tilt_max": 35.0,
        "behavior.trajectory_speed_max": 3.0,
    }
    within = quickest(0.9, 20.0, limits.__getitem__)
    assert (within.radius, within.laps) == (0.9, 7)  # 7 laps of 3.33 s, less a ramp
    assert within.period == pytest.approx(2.0 * np.pi * np.sqrt(0.9 / (0.8 * 4.0)))
    quick = quickest(3.0, 20.0, limits.__getitem__)  # its speed is the bound
    assert quick.radius == pytest.approx(2.4**2 / 3.2)
    assert quick.period == pytest.approx(2.0 * np.pi * 2.4 / 3.2)
    level = quickest(0.9, 20.0, (limits | {"behavior.trajectory_tilt_max": 10.0}).__getitem__)
    tilt = np.tan(np.radians(0.8 * 10.0))
    assert level.period == pytest.approx(2.0 * np.pi * np.sqrt(0.9 / (GRAVITY * tilt)), rel=0.01)
