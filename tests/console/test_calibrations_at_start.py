"""The drift measured at the vehicle's start arrives some time after the vehicle is ready."""

from __future__ import annotations

import time
from typing import Any

import pytest

from console import calibrations
from console.calibrations import Calibrations
from tests.support.clients import FakeClient
from tests.support.narrowing import now as as_it_is
from vehicle_link.messages import new
from vehicle_link.topics.table import SERVICES


class Silent:
    """Node to a vehicle that has no calibration yet; it counts the requests."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def client(self, name: str, srv_type: str, *, priority: str) -> FakeClient:
        return FakeClient(name, srv_type, self._answer)

    def serve(self, name: str, srv_type: str, handler: Any) -> None:
        pass

    def _answer(self, request: Any) -> Any:
        self.asked.append(str(request.action))
        return new(f"{SERVICES['calibrate']}_Response", accepted=True)


def test_it_is_asked_for_again_until_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    node = Silent()
    known = Calibrations(node)  # type: ignore[arg-type]
    known.look(1)
    assert not known.is_due, "nothing is awaited of a vehicle that did not start"
    known.status(True)
    known.status(False)
    known.look(1)
    assert as_it_is(known).is_due
    known.look(1)
    assert node.asked.count("in_force") == 3
    now = time.monotonic() + calibrations.START_PATIENCE
    monkeypatch.setattr(time, "monotonic", lambda: now)
    known.look(1)
    assert not known.is_due, "it does not come any more"
