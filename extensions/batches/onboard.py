"""The laws of one onboard step as one compiled function: the item-level ones of the vehicle's tick.

estimate (Sec. 6.1) -> reference (to its fourth derivative) -> eqs. 4 and 5 with feed-forward
-> allocation. `vehicle.flight.stack` composes them in Python, with plugins, behaviors and safety.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from control.disturbance_observer import OBSERVER, OBSERVER_MEMORY, observe_one, observer_record
from control.geometric_law import CONTROL_MEMORY, new_control_memory, step_one
from control.parameters import CONTROL, ControlParameters, control_record
from control.trajectories.figure_eight import FIGURE_EIGHT, FigureEight, figure_eight_at
from estimation.memory import ESTIMATOR_MEMORY, new_memory
from estimation.parameters import ESTIMATION_GAINS, EstimationParameters, estimation_record
from quadrotor.compiled import compiled
from quadrotor.records import ACTUATORS, ESTIMATE, IMU_SAMPLE, REFERENCE, STATE, Item, Record
from quadrotor.vehicle_model import MODEL, VehicleModel

Array = npt.NDArray[np.float64]

SETTINGS = np.dtype(
    [
        ("estimation", ESTIMATION_GAINS),
        ("control", CONTROL),
        ("model", MODEL),  # the controller's model
        ("eight", FIGURE_EIGHT),
        ("observer", OBSERVER),
    ],
    align=True,
)
"""Everything that stays constant in flight."""

ONBOARD = np.dtype(
    [
        ("estimator", ESTIMATOR_MEMORY),
        ("controller", CONTROL_MEMORY),
        ("imu", IMU_SAMPLE),
        ("state", STATE),
        ("reference", REFERENCE),
        ("actuators", ACTUATORS),
        ("estimate", ESTIMATE),
        ("observer", OBSERVER_MEMORY),
    ],
    align=True,
)
"""Everything that changes in flight."""


def new_settings(
    eight: FigureEight,
    model: VehicleModel,
    control: ControlParameters,
    estimation: EstimationParameters,
) -> Record:
    """Return a SETTINGS record, shape (1,)."""
    out = np.zeros(1, SETTINGS)
    out["estimation"] = estimation_record(estimation)
    out["control"] = control_record(control)
    out["model"] = model.record()
    out["eight"] = eight._eight
    out["observer"] = observer_record(control.disturbance)
    return out


def new_onboard() -> Record:
    """Return an ONBOARD record, shape (1,): filters waiting for a first pose, empty integrals."""
    out = np.zeros(1, ONBOARD)
    out["estimator"] = new_memory()
    out["controller"] = new_control_memory()
    out["state"]["quaternion_wb"][:, 0] = 1.0
    return out


@compiled(inner=True)
def observe_disturbance(v: Item, s: Item, airborne: bool, dt: float) -> None:
    """Write what the law has to subtract, if the observer is on."""
    if s.observer.force == 1 or s.observer.torque == 1:
        found, carried = v.controller.disturbance, False
        observe_one(
            v.observer,
            v.state,
            v.actuators,
            s.observer,
            s.model,
            airborne,
            carried=carried,
            dt=dt,
            out=found,
        )


@compiled(inner=True)
def control(v: Item, s: Item, airborne: bool, dt: float) -> None:
    """Compute the actuators of the ONBOARD record v for its state and reference."""
    step_one(
        v.controller,
        v.state,
        v.reference,
        s.control,
        s.model,
        airborne,
        dt=dt,
        actuators=v.actuators,
    )


@compiled(inner=True)
def steer(v: Item, s: Item, t: float, airborne: bool, dt: float) -> None:
    """Compute the actuators of the ONBOARD record v for its state, t (s) into the 8."""
    observe_disturbance(v, s, airborne, dt)
    figure_eight_at(s.eight, t, v.reference)
    control(v, s, airborne, dt)
