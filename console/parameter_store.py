"""The station's own parameters behind one lock, with everybody told of each change."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from console.parameters import StationParameters, StationTree
from quadrotor.parameters import ParameterDescription, ParameterStore, ParameterValue

PREFIX = "station."

OnChange = Callable[[str, ParameterValue, ParameterValue, str, int], None]
"""Name, old value, new value, requester, revision."""


class StationStore:
    """The backend of the station's parameter services; thread-safe.

    Args:
        on_change: called once for each value that really changed, outside any lock.
    """

    def __init__(self, on_change: OnChange = lambda *_: None) -> None:
        self._tree = StationTree(
            station=StationParameters().model_copy(deep=True)  # never the class's defaults
        )
        self._store = ParameterStore(self._tree)
        self._lock = threading.Lock()
        self.on_change = on_change

    @property
    def parameters(self) -> StationParameters:
        """The live objects, read by whoever uses them; only `change` writes."""
        return self._tree.station

    @property
    def revision(self) -> int:
        return self._store.revision

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return self._store.descriptions()

    def values(self) -> dict[str, ParameterValue]:
        return self._store.values()

    def check(self, values: Mapping[str, object]) -> None:
        """Raises ParameterError when `change` would."""
        for name, value in values.items():
            self._store.check(name, value)

    def preset(self, values: Mapping[str, object]) -> None:
        """Before the start, from the command line. Raises ParameterError."""
        self._store.preset(values)

    def change(
        self, values: Mapping[str, object], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """(applied values, revision); all or nothing. Raises ParameterError."""
        with self._lock:
            before = self._store.values()
            applied = self._store.set(values)
            revision = self._store.revision
        for name, value in applied.items():
            if value != before[name]:
                self.on_change(name, before[name], value, requester, revision)
        return applied, revision
