"""All faults that `simulator.faults` takes, and how they act on a plant and its sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bearing_sim.faults.fault import OF_SIMULATOR, Active, Catalogue, moved
from vehicle.simulator.faults.body import BODY
from vehicle.simulator.faults.imu import IMU
from vehicle.simulator.faults.supply import SUPPLY
from vehicle.simulator.faults.truth import Truth, VehicleFault
from vehicle.simulator.faults.world import WORLD

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    import numpy.typing as npt

    from vehicle.simulator.parameters import SimulatorParameters

VEHICLE: tuple[type[VehicleFault], ...] = (*IMU, *SUPPLY, *BODY, *WORLD)
CATALOGUE = Catalogue(OF_SIMULATOR, {one.name: one for one in VEHICLE})


def truth_of(
    parameters: SimulatorParameters, active: Sequence[Active], position_w: npt.NDArray[np.float64]
) -> Truth:
    """Return what is true while these faults are on, of a vehicle at this place, (3,) m."""
    truth = Truth(moved(parameters, active).model_copy(), position_w)
    for one in active:
        if isinstance(one.fault, VehicleFault):
            one.fault.act(truth, one.moment, one.memory)
    return truth


def state_of(active: Sequence[Active]) -> tuple[tuple[int, float, float], ...]:
    """Return a key that stays equal while these faults change nothing."""
    return tuple(
        (id(one.fault), one.moment.level, one.moment.elapsed if one.fault.varies else 0.0)
        for one in active
    )
