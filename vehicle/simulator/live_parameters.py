"""The simulator's parameters during a flight: read and set by services, applied by the loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from bearing_sim.faults.fault import OF_SIMULATOR
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from quadrotor.parameters import Parameters, ParameterStore
from vehicle.simulator.faults.table import CATALOGUE
from vehicle.simulator.parameters import SimulatorParameters

CHARGE = "simulator.battery_charge"

OnChange = Callable[[str, ParameterValue, ParameterValue, str, int], None]
"""Callback with name, old value, new value, requester, revision."""


class SimulatorTree(Parameters):
    """The root of the tree, which gives every name its `simulator.` prefix."""

    simulator: SimulatorParameters = SimulatorParameters()


class LiveParameters:
    """Backend of the simulator's parameter services; thread-safe.

    Args:
        lacking: faults that the vehicle's board cannot have, and why.
    """

    def __init__(
        self, parameters: SimulatorParameters, lacking: Mapping[str, str] | None = None
    ) -> None:
        self._catalogue = replace(CATALOGUE, lacking=lacking or {})
        self._tree = SimulatorTree(simulator=parameters.model_copy(deep=True))
        self._store = ParameterStore(self._tree)
        self._lock = threading.Lock()
        self._is_news = False
        self._charge: float | None = None

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return self._store.descriptions()

    def values(self) -> dict[str, ParameterValue]:
        return self._store.values()

    def change(
        self,
        values: Mapping[str, ParameterValue],
        requester: str,
        on_change: OnChange = lambda *_: None,
    ) -> tuple[dict[str, ParameterValue], int]:
        """Return (applied values, revision); all or nothing. Raises ParameterError.

        Args:
            on_change: called once for each value that changed.
        """
        with self._lock:
            before = self._store.values()
            self._catalogue.parse(str(values.get(OF_SIMULATOR, "")), self._tree.simulator)
            applied = self._store.set(values)
            revision = self._store.revision
            self._is_news = True
            if CHARGE in values:  # even if unchanged, as the battery has drained since
                self._charge = float(applied[CHARGE])
        for name, value in applied.items():
            if value != before[name]:
                on_change(name, before[name], value, requester, revision)
        return applied, revision

    def pop_charge(self) -> float | None:
        """Return the battery's charge if it was set since the last call; blocks only briefly."""
        if self._charge is None:
            return None
        with self._lock:
            charge, self._charge = self._charge, None
            return charge

    def pop_changed(self) -> SimulatorParameters | None:
        """Return a copy of the parameters if changed since the last call; blocks only briefly."""
        if not self._is_news:
            return None
        with self._lock:
            self._is_news = False
            return self._tree.simulator.model_copy(deep=True)


@dataclass(frozen=True)
class ReportingParameters:
    """Backend of the parameter services of one node, which publishes the changes."""

    live: LiveParameters
    on_change: OnChange

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return self.live.descriptions()

    def values(self) -> dict[str, ParameterValue]:
        return self.live.values()

    def change(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        return self.live.change(values, requester, self.on_change)
