"""The station's copy of the vehicle's parameters, for runs' files and for what must be the same."""

from __future__ import annotations

import threading

from quadrotor.errors import LinkError
from quadrotor.parameters import ParameterValue
from vehicle_link.parameters.service import ParameterClient
from vehicle_link.transport.node import Node


class VehicleParameters:
    """Fetched again whenever the vehicle's status shows another revision."""

    def __init__(self, node: Node, vehicle: str) -> None:
        self._client = ParameterClient(node, f"/{vehicle}/vehicle", timeout=1.0)
        self._fetching = threading.Lock()
        self._values: dict[str, ParameterValue] | None = None
        self._revision = -1
        self._defaults: dict[str, ParameterValue] = {}
        self.shown_revision = -1  # in the vehicle's status

    def refresh(self) -> None:
        """Fetch when what we have is not what the vehicle shows. Raises LinkError."""
        with self._fetching:
            wanted = self.shown_revision
            if wanted >= 0 and wanted != self._revision:
                self._values = self._client.values()
                self._revision = wanted

    def learn_defaults(self) -> None:
        """Fetch those of parameters that are new here: at first, and of another version of the
        vehicle. Takes some answers of the vehicle. Raises LinkError."""
        values = self._values
        if values is not None and not values.keys() <= self._defaults.keys():
            described = self._client.describe()
            self._defaults = {one.name: one.default for one in described}

    def defaults(self) -> dict[str, ParameterValue]:
        """Return the defaults by name, of all that have a value; empty while they are not known.
        Never waits.
        """
        values, defaults = self._values or {}, self._defaults
        return defaults if values and values.keys() <= defaults.keys() else {}

    @property
    def in_step(self) -> bool:
        """Return whether our values are those the vehicle shows, without waiting."""
        return self._values is not None and self._revision == self.shown_revision

    def newest(self, name: str) -> ParameterValue | None:
        """Return the value as it was fetched last, even if old; None when it was not. Never
        waits.
        """
        values = self._values
        return None if values is None else values.get(name)

    def known(self, name: str) -> ParameterValue | None:
        """Return the value as it was fetched; None when the vehicle has none, or shows a newer
        revision.
        """
        with self._fetching:
            if self._values is None or self._revision != self.shown_revision:
                return None
            return self._values.get(name)

    def present(self) -> tuple[dict[str, ParameterValue], int] | None:
        """Return (values, revision) as they were fetched; None when the vehicle shows a newer
        one.
        """
        with self._fetching:
            if self._values is None or self._revision != self.shown_revision:
                return None
            return self._values, self._revision

    def snapshot(self) -> tuple[dict[str, ParameterValue] | None, int, str]:
        """Return (values or None, revision, why there are none or old ones); may wait 1 s."""
        try:
            self.refresh()
        except LinkError as error:
            return self._values, self._revision, str(error)
        return self._values, self._revision, ""
