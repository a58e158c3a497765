"""The faults of one simulated vehicle, and when they change what is true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bearing_sim.faults.fault import Active, Faults, moved
from vehicle.simulator.faults.table import CATALOGUE
from vehicle.simulator.faults.truth import Truth, VehicleFault

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vehicle.simulator.parameters import SimulatorParameters


class ActingFaults:
    """The faults that the vehicle's parameters name, on their clocks.

    Args:
        lacking: faults that the vehicle's board cannot have, and why.
    """

    def __init__(self, lacking: Mapping[str, str]) -> None:
        self._faults = Faults(replace(CATALOGUE, lacking=lacking))
        self._acted: tuple[tuple[int, float, float], ...] | None = ()

    def __bool__(self) -> bool:
        return bool(self._faults or self._acted is None or self._acted)

    def set(self, parameters: SimulatorParameters, now_ns: int) -> None:
        """Run the faults of these parameters from now on, and act with the next `truth`.

        Raises OutOfBoundsError.
        """
        if parameters.faults != self._faults.text:
            self._faults.set(parameters.faults, parameters, now_ns)
        self._acted = None

    def truth(
        self,
        parameters: SimulatorParameters,
        now_ns: int,
        position_w: npt.NDArray[np.float64],
        has_read: bool,
    ) -> Truth | None:
        """Return the present truth, None if it has not changed since the last call.

        Args:
            position_w: of the vehicle, (3,) m.
            has_read: whether the sensors have a reading that could stick.
        """
        active = self._faults.active(now_ns, parameters.seed)
        acted = tuple(
            (id(one.fault), one.moment.level, one.moment.elapsed if one.fault.varies else 0.0)
            for one in active
        )
        if acted == self._acted:
            return None
        self._acted = acted
        truth = _truth_of(parameters, active, position_w)
        if truth.stuck and not has_read:
            truth.stuck, self._acted = set(), None
        return truth


def _truth_of(
    parameters: SimulatorParameters, active: Sequence[Active], position_w: npt.NDArray[np.float64]
) -> Truth:
    truth = Truth(moved(parameters, active).model_copy(), position_w)
    for one in active:
        if isinstance(one.fault, VehicleFault):
            one.fault.act(truth, one.moment, one.memory)
    return truth
