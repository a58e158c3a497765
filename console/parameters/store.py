"""The station's own parameters behind one lock, with a notification of each change."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from console.parameters.station import StationParameters, StationTree, station_parameters
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore

PREFIX = "station."

BeforeChange = Callable[[Mapping[str, ParameterValue], str], None]
"""Called with values and requester; raises ParameterError to refuse them."""

OnChange = Callable[[str, ParameterValue, ParameterValue, str, int], None]
"""Called with name, old value, new value, requester, revision."""


class StationStore(ParameterStore):
    """The backend of the station's parameter services; thread-safe."""

    def __init__(self) -> None:
        self._tree = StationTree(
            station=station_parameters().model_copy(deep=True)  # never the class's defaults
        )
        super().__init__(self._tree)
        self._lock = threading.Lock()
        self._notifying = threading.Lock()
        self._before_change: BeforeChange = lambda *_: None
        self._on_change: OnChange = lambda *_: None

    @property
    def parameters(self) -> StationParameters:
        """Return the live objects, which their users read directly; only `change` writes."""
        return self._tree.station

    def subscribe(self, on_change: OnChange) -> None:
        """Call `on_change` once for each value that really changes, in the order of the revisions,
        instead of the previous one; it may read here but not change.
        """
        self._on_change = on_change

    def consult(self, before_change: BeforeChange) -> None:
        """Call `before_change` with valid values before they are applied, outside any lock; it may
        raise ParameterError.
        """
        self._before_change = before_change

    def change(
        self, values: Mapping[str, object], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """Change values, all or nothing; return (applied values, revision). Raises
        ParameterError.
        """
        self._before_change(self.tried(values), requester)
        with self._notifying:
            with self._lock:
                before = self.values()
                applied = self.set(values)
                revision = self.revision
            for name, value in applied.items():
                if value != before[name]:
                    self._on_change(name, before[name], value, requester, revision)
        return applied, revision

    def tried(self, values: Mapping[str, object]) -> dict[str, ParameterValue]:
        """Return the values as they would be applied, without calling what `consult` set. Raises
        ParameterError.

        They are tried on a copy: texts such as the beacons' layout are checked on assignment, and
        when one of several values is refused, none may stay.
        """
        return ParameterStore(self._tree.model_copy(deep=True)).set(values)
