"""Clients of services that a function of the test answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vehicle_link.transport.client import TIMEOUT, ServiceClient


class FakeClient(ServiceClient[Any]):
    def __init__(self, name: str, srv_type: str, answer: Callable[[Any], Any]) -> None:
        self._name, self._type, self._answer = name, srv_type, answer

    def call(self, request: Any, timeout: float = TIMEOUT) -> Any:
        return self._answer(request)
