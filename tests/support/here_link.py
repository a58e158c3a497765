"""A link to a plugin that runs in the process of the test."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.python_file import call_user_code
from vehicle.plugins.contract import Contract, as_attributes
from vehicle.plugins.host import load, set_values


class HereLink:
    """A link to a plugin, which never answers once it has an attribute `stalls`.

    Attributes:
        closed: whether the vehicle has let it go.
    """

    def __init__(self, contract: Contract, path: Path) -> None:
        self._contract, self._path, self._plugin = contract, path, load(contract, path)
        self._answer: bytes | None = None
        self._why: QuadlabError | None = None
        self.closed = False

    def ready(self) -> bool:
        return True

    def send(self, data: bytes) -> None:
        contract, plugin = self._contract, self._plugin
        if len(data) != contract.inputs.itemsize:
            set_values(plugin, data)
            return
        x = as_attributes(np.frombuffer(bytearray(data), contract.inputs))
        out = np.zeros(1, contract.outputs)
        try:
            call_user_code(self._path, lambda: contract.step(plugin, x, out), RefusedError)
        except QuadlabError as error:
            self._why = error
        self._answer = None if hasattr(plugin, "stalls") else out.tobytes()

    def receive(self) -> bytes | None:
        if self._why is not None:
            raise self._why
        answer, self._answer = self._answer, None
        return answer

    def close(self) -> None:
        self.closed = True
