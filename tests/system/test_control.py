"""One person commands a real laboratory; others see who it is, and may land it anyway."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
import websockets.exceptions
import websockets.sync.client

pytestmark = pytest.mark.timeout(180)
GAIN = "control.position.kp_xy"
COMMANDS: list[tuple[str, str, Any]] = [
    ("POST", "/api/commands/arm", {}),
    ("POST", "/api/commands/disarm", {}),
    ("POST", "/api/commands/start_behavior", {"name": "hover"}),
    ("POST", "/api/commands/record", {"start": True}),
    ("PUT", "/api/parameters", {"values": {GAIN: 5.0}}),
    ("PUT", "/api/parameters", {"values": {"station.sticks.timeout": 0.3}}),
    ("PUT", "/api/beacons", {"preset": "wall"}),
    ("POST", "/api/experiments/start", {"name": "hover"}),
    ("POST", "/api/experiments/stop", {}),
]


class Person:
    """Person with a separate browser at this laboratory."""

    def __init__(self, lab: Any, url: str) -> None:
        self.client = httpx.Client(base_url=lab.url, headers={"origin": lab.url}, timeout=10)
        token = url.partition("token=")[2]
        assert self.client.post("/login", data={"token": token}).status_code == 200
        self.label = self.client.get("/api/session").json()["label"]
        self._lab = lab

    def ask(self, method: str, path: str, body: Any) -> tuple[int, str]:
        answer = self.client.request(method, path, json=body)
        return answer.status_code, str(answer.json().get("error", ""))

    def control(self, action: str) -> int:
        return self.ask("POST", "/api/control", {"action": action})[0]

    @contextlib.contextmanager
    def page(self) -> Iterator[None]:
        """Keep a page open, as far as the server can tell, by reading what is sent."""
        cookie = "; ".join(f"{k}={v}" for k, v in self.client.cookies.items())
        socket = websockets.sync.client.connect(
            f"{self._lab.url.replace('http', 'ws')}/ws/events",
            additional_headers={"Cookie": cookie},
            origin=self._lab.url,
            proxy=None,
        )

        def read() -> None:
            with contextlib.suppress(websockets.exceptions.ConnectionClosed):
                for _ in socket:
                    pass

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        yield
        socket.close()
        reader.join()


def test_one_commands_and_control_is_asked_for_given_and_lost_by_leaving(
    lab: Any, until: Callable[..., Any]
) -> None:
    lab.reach(mode="ready")

    def invited(role: str) -> Person:
        answer = lab.browser.post("/api/invitations", json={"role": role})
        return Person(lab, answer.json()["url"])

    anna, ben, vera = invited("operator"), invited("operator"), invited("viewer")

    def holder() -> str:
        return str((lab.summary().get("control") or {}).get("holder", "?"))

    def known() -> bool:
        names = {parameter["name"] for parameter in lab.get("/api/parameters")["parameters"]}
        return {GAIN, "station.sticks.timeout"} <= names

    until("the parameters of vehicle and station", known, 20)
    before = lab.get("/api/parameters")
    with anna.page():
        assert anna.control("ask") == 200
        until("anna to have control", lambda: holder() == anna.label, 5)
        for method, path, body in COMMANDS:
            status, line = ben.ask(method, path, body)
            assert (status, line) == (409, line), (path, status)
            assert line.startswith(f"{anna.label} has control"), (path, line)
            assert vera.ask(method, path, body)[0] == 403, path
        assert lab.get("/api/parameters") == before
        assert lab.status()["mode"] == "ready"
        assert ben.control("take") == 403

        # Anyone may send emergencies; with its motors off the vehicle itself refuses them.
        land, cut = {"action": "land"}, {"action": "cut"}
        for person in (ben, vera):
            answer = person.ask("POST", "/api/commands/emergency", land)
            assert answer == (409, "emergency land refused: the motors are off")
        assert vera.ask("POST", "/api/commands/emergency", cut)[0] == 403
        until("arming", lambda: anna.ask("POST", "/api/commands/arm", {})[0] == 200, 20)
        lab.reach(mode="armed")
        assert ben.ask("POST", "/api/commands/emergency", cut)[0] == 200
        lab.reach(mode="cut")
        assert anna.ask("POST", "/api/commands/disarm", {})[0] == 200  # acknowledges the cut
        lab.reach(mode="ready")

        assert ben.control("ask") == 200
        until("the question", lambda: lab.summary()["control"]["asking"] == ben.label, 5)
        assert anna.control("give") == 200
        until("ben to have control", lambda: holder() == ben.label, 5)
        assert anna.ask("POST", "/api/commands/arm", {})[0] == 409

    with ben.page():
        assert ben.ask("PUT", "/api/parameters", {"values": {GAIN: 4.5}})[0] == 200
    until("control to be free after the last page has closed", lambda: holder() == "", 15)
    assert anna.ask("PUT", "/api/parameters", {"values": {GAIN: 4.0}})[0] == 200
    assert lab.browser.post("/api/control", json={"action": "take"}).status_code == 200
    assert re.search(r"has control", lab.output)
