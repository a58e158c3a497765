"""The beacons in force survive a restart of the station's process."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from console.beacon_layout import STATION_LAYOUT
from console.catalogue.catalogue import Catalogue
from console.parameters.history import ParameterHistory
from quadrotor.errors import LinkError
from tests.waiting import free_port, until, wait_for
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters, to_parameters
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import ParameterClient

STATION = """
import json, sys
from pathlib import Path
from console.station import run_station
data, vehicle, loopback, settings = sys.argv[1:]
run_station(Path(data), {"quad1": vehicle}, int(loopback), settings=json.loads(settings))
"""
CHANGE = SERVICES["change_parameters"]


class Running:
    """A station's process, and a node next to it."""

    def __init__(self, loopback: int) -> None:
        self._session = loopback_session(loopback)
        self._node = Node(self._session, "/quad1", "page")
        self._change = self._node.client("station/change_parameters", CHANGE)
        self._parameters = ParameterClient(self._node, "/quad1/station")

    def close(self) -> None:
        self._node.close()
        self._session.close()

    @property
    def layout(self) -> str:
        return str(self._asked(lambda: self._parameters.values())[STATION_LAYOUT])

    def move(self, text: str) -> None:
        request = new(
            f"{CHANGE}_Request",
            request_id="1",
            requester="ada",
            parameters=to_parameters({STATION_LAYOUT: text}),
        )
        answer = self._asked(lambda: self._change.call(request, timeout=5.0))
        assert answer.accepted, answer.reason
        assert from_parameters(answer.applied) == {STATION_LAYOUT: text}

    def _asked(self, ask: Callable[[], Any]) -> Any:
        def answer() -> Any:
            try:
                return ask()
            except LinkError:
                return None

        found = until(answer)
        assert found is not None
        return found


@contextmanager
def station(data: Path, **settings: Any) -> Iterator[Running]:
    """Start a station that is killed at the end, as one that crashes."""
    vehicle, loopback = free_port(socket.SOCK_DGRAM), free_port()
    given = json.dumps({name.replace("__", "."): value for name, value in settings.items()})
    child = subprocess.Popen(
        [sys.executable, "-c", STATION, str(data), f"127.0.0.1:{vehicle}", str(loopback), given],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    try:
        lines = child.stdout
        assert lines is not None
        until(lambda: "serves" in lines.readline())
        running = Running(loopback)
        yield running
        running.close()
    finally:
        child.kill()
        child.communicate()


def test_a_station_that_is_killed_and_started_again_keeps_the_beacons_in_force(
    tmp_path: Path,
) -> None:
    with station(tmp_path) as first:
        before = first.layout
        first.move("eight")
        known = ParameterHistory(Catalogue(tmp_path).engine, "quad1").known
        wait_for(lambda: known().get(STATION_LAYOUT) == "eight")
    assert before != "eight"
    with station(tmp_path) as again:
        assert again.layout == "eight"
    with station(tmp_path, station__bearings__layout="wall") as told:
        assert told.layout == "wall", "what is given at the start counts"


@pytest.mark.parametrize("text", ["papier", ""])
def test_a_layout_that_is_none_any_more_is_not_taken_up_and_said(tmp_path: Path, text: str) -> None:
    catalogue = Catalogue(tmp_path)
    ParameterHistory(catalogue.engine, "quad1").learn({STATION_LAYOUT: text})
    catalogue.close()
    with station(tmp_path) as running:
        assert running.layout != text
