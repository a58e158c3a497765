"""Before the laboratory stops, each vehicle in the air lands and each on the ground disarms."""

from __future__ import annotations

import itertools
import threading
from typing import Any

import pytest

from quadlab.up import landing
from quadlab.up.landing import land_before_stopping
from quadrotor.errors import RefusedError
from tests.waiting import LIMIT, free_port
from vehicle_link.messages import encode, header, new
from vehicle_link.termination_signal import EndSignal
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.session import hub_session

STATUS = "quadlab_msgs/VehicleStatus"


class Station:
    """A station with one vehicle that does at once what it is asked.

    Attributes:
        asked: the commands in their order.
        refusals: why the next commands are refused.
    """

    def __init__(self, port: int, behavior: str, *, airborne: bool) -> None:
        self.asked: list[str] = []
        self.refusals: list[str] = []
        self._behavior, self._airborne, self._armed = behavior, airborne, True
        self._session = hub_session(port)
        self._node = Node(self._session, "/quad1", "station")
        for name in ("start_behavior", "disarm"):
            self._node.serve(f"station/{name}", SERVICES[name], getattr(self, f"_{name}"))
        self._status = self._node.advertise(TOPICS["status"])
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._report)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        self._node.close()
        self._session.close()

    def _start_behavior(self, request: Any) -> Any:
        self._note(f"{request.name} by {request.requester}")
        self._airborne = self._armed = False
        return new(f"{SERVICES['start_behavior']}_Response", accepted=True)

    def _disarm(self, request: Any) -> Any:
        self._note(f"disarm by {request.requester}")
        self._armed = False
        return new(f"{SERVICES['disarm']}_Response", accepted=True)

    def _note(self, command: str) -> None:
        self.asked.append(command)
        if self.refusals:
            raise RefusedError(self.refusals.pop(0))

    def _report(self) -> None:
        for number in itertools.count(1):
            if self._closing.wait(0.02):
                return
            status = new(
                STATUS,
                header=header(number),
                mode="armed" if self._armed else "ready",
                behavior=self._behavior,
                armed=self._armed,
                airborne=self._airborne,
            )
            self._status.put(encode(status), number)


@pytest.fixture
def stop() -> EndSignal:
    return EndSignal(())


def stopped(behavior: str, *, airborne: bool, refusals: list[str], stop: EndSignal) -> list[str]:
    """Return what the station is asked until the vehicle's motors are off."""
    port = free_port()
    station = Station(port, behavior, airborne=airborne)
    station.refusals = refusals
    try:
        ending = threading.Thread(target=land_before_stopping, args=(port, ["quad1"], stop))
        ending.start()
        ending.join(LIMIT)
        assert not ending.is_alive()
    finally:
        station.close()
    return station.asked


def test_a_vehicle_that_is_armed_on_the_ground_is_disarmed(
    stop: EndSignal, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = stopped("ground", airborne=False, refusals=[], stop=stop)
    assert asked == ["disarm by quadlab up"]
    assert "not on the ground" not in capsys.readouterr().out


def test_a_landing_that_was_refused_is_asked_for_again_and_its_reason_told_once(
    stop: EndSignal, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(landing, "ASK_AGAIN", 0.05)
    asked = stopped("hover", airborne=True, refusals=["no fresh pose"] * 3, stop=stop)
    assert asked == ["land by quadlab up"] * 4
    assert capsys.readouterr().out.count("no fresh pose") == 1
