"""The station's copy of the vehicle's parameters, for runs' files and for what must be the same."""

from __future__ import annotations

import threading

from quadrotor.errors import LinkError
from quadrotor.parameters import ParameterValue
from vehicle_link.parameters.service import ParameterClient
from vehicle_link.transport.node import Node


class VehicleParameters:
    """Fetched again whenever the vehicle's status shows another revision, or another process.

    Attributes:
        shown: (process instance, revision) in the vehicle's status; None before the first one.
    """

    def __init__(self, node: Node, vehicle: str) -> None:
        self._client = ParameterClient(node, f"/{vehicle}/vehicle", timeout=1.0)
        self._fetching = threading.Lock()
        self._values: dict[str, ParameterValue] | None = None
        self._read_at: tuple[int, int] | None = None
        self._defaults: dict[str, ParameterValue] = {}
        self.shown: tuple[int, int] | None = None

    def refresh(self) -> None:
        """Fetch when what we have is not what the vehicle shows. Raises LinkError."""
        with self._fetching:
            wanted = self.shown
            if wanted is not None and wanted != self._read_at:
                self._values = self._client.values()
                self._read_at = wanted

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
        return self._values is not None and self._read_at == self.shown

    def newest(self, name: str) -> ParameterValue | None:
        """Return the value as it was fetched last, even if old; None when it was not. Never
        waits.
        """
        values = self._values
        return None if values is None else values.get(name)

    def known(self, name: str) -> ParameterValue | None:
        """Return the value; None when the vehicle has none, or shows a newer revision."""
        present = self.present()
        return None if present is None else present[0].get(name)

    def present(self) -> tuple[dict[str, ParameterValue], tuple[int, int]] | None:
        """Return (values, (instance, revision)); None when the vehicle shows newer ones."""
        with self._fetching:
            values, read_at = self._values, self._read_at
            if values is None or read_at is None or read_at != self.shown:
                return None
            return values, read_at

    def snapshot(self) -> tuple[dict[str, ParameterValue] | None, int, str]:
        """Return (values or None, revision, why there are none or old ones); may wait 1 s."""
        problem = ""
        try:
            self.refresh()
        except LinkError as error:
            problem = str(error)
        return self._values, -1 if self._read_at is None else self._read_at[1], problem
