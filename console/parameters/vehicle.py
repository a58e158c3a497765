"""The station's copy of the vehicle's parameters, for runs' files and for shared values."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from quadrotor.errors import LinkError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.parameters.replica import ParameterReplica, Snapshot
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import ParameterClient


class VehicleParameters(ParameterReplica):
    """A replica that fetches the values when a change was missed.

    Args:
        known: values from an earlier station, from the history.
    """

    def __init__(self, node: Node, vehicle: str, known: Mapping[str, ParameterValue]) -> None:
        super().__init__(known)
        self._client = ParameterClient(node, f"/{vehicle}/vehicle", timeout=1.0)
        self._fetching = threading.Lock()
        self._defaults: dict[str, ParameterValue] = {}
        self._on_snapshot: Callable[[Snapshot], None] = lambda _: None

    def subscribe(self, on_snapshot: Callable[[Snapshot], None]) -> None:
        """Call `on_snapshot` with each snapshot, in the thread that fetched it."""
        self._on_snapshot = on_snapshot

    def refresh(self) -> None:
        """Fetch all values when a snapshot is due. Raises LinkError."""
        with self._fetching:
            if not self.is_due or self.shown is None:
                return
            (instance, revision), since = self.shown, self.clock
            self._on_snapshot(self.load(self._client.values(), revision, instance, since))

    def learn_defaults(self) -> None:
        """Fetch the defaults when there are new parameters: at first, and after another version of
        the vehicle has connected. Needs several answers of the vehicle. Raises LinkError.
        """
        if self.instance is not None and not self.values().keys() <= self._defaults.keys():
            described = self._client.describe()
            self._defaults = {one.name: one.default for one in described}

    def defaults(self) -> dict[str, ParameterValue]:
        """Return the defaults by name, for all parameters that have a value; empty while they are
        unknown. Never waits.
        """
        is_known = self.instance is not None and self.values().keys() <= self._defaults.keys()
        return self._defaults if is_known else {}

    def newest(self, name: str) -> ParameterValue | None:
        """Return the newest value, even if outdated; None before the first snapshot.
        Never waits.
        """
        return None if self.instance is None else self.value(name)

    def known(self, name: str) -> ParameterValue | None:
        """Return the value; None when it is missing, or the vehicle has reported a
        newer revision.
        """
        return self.value(name) if self.in_step else None

    def snapshot(self) -> tuple[dict[str, ParameterValue] | None, int, str]:
        """Return (values or None, revision, why they are missing or outdated); may wait 1 s."""
        problem = ""
        try:
            self.refresh()
        except LinkError as error:
            problem = str(error)
        return None if self.instance is None else self.values(), self.revision, problem
