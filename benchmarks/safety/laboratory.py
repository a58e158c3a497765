"""A `quadlab up` as a process, and a client that commands it as a person at the page would."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import httpx

from benchmarks.harness import free_port
from quadrotor.checkout import ROOT
from quadrotor.errors import QuadlabError

T = TypeVar("T")
CHARGE = 20
"""Capacity, in A h, of a battery that outlasts all flights."""
PATIENCE = 300.0  # s
LOOK = 0.3  # s
LINK = re.compile(r"http://\S+token=\S+")


class Laboratory:
    """A running laboratory and a client that is signed in, with the vehicle on the ground.

    Args:
        words: options of `quadlab up`.
        before: command words in front of it.

    Attributes:
        lines: what it printed.
        browser: the client, whose requests carry the page's origin.
    """

    def __init__(self, data: Path, *words: str, before: Sequence[str] = ()) -> None:
        self.data, self.port, self.link_port = data, free_port(), free_port()
        self.up = subprocess.Popen(
            [
                *before,
                *(sys.executable, "-m", "quadlab", "up", "--no-browser"),
                *("--data", str(data)),
                *("--port", str(self.port), "--link-port", str(self.link_port)),
                *("--set", f"simulator.battery_capacity={CHARGE}"),
                *words,
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=ROOT,
        )
        self.lines: list[str] = []
        assert self.up.stdout is not None
        lines = iter(self.up.stdout.readline, "")
        threading.Thread(target=lambda: self.lines.extend(lines), daemon=True).start()
        self.browser = httpx.Client()
        try:
            self.link = self.until("the link", self._links)[-1]
            self.base = self.link.split("/?")[0]
            self.browser = self.client()
            token = {"token": self.link.partition("token=")[2]}
            self.browser.post("/login", data=token).raise_for_status()
            self.until("ready", lambda: self.status().get("mode") == "ready")
        except (QuadlabError, httpx.HTTPError):
            self.close()
            raise

    def client(self) -> httpx.Client:
        """Return another client, which is not signed in."""
        base = self.link.split("/?")[0]
        return httpx.Client(base_url=base, headers={"origin": base}, timeout=30)

    def until(self, what: str, look: Callable[[], T], patience: float = PATIENCE) -> T:
        """Wait until `look` returns a true value. Raises QuadlabError."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if self.up.poll() is not None:
                raise QuadlabError("`quadlab up` has ended: " + self.last_lines())
            if found := look():
                return found
            time.sleep(LOOK)
        raise QuadlabError(f"waited {patience:.0f} s for {what} in vain: " + self.last_lines())

    def last_lines(self, count: int = 5) -> str:
        """Return the newest lines, in one."""
        return " | ".join(line.strip() for line in self.lines[-count:] if line.strip())

    def get(self, path: str) -> Any:
        """Return what the page answers; an empty object if it does not."""
        try:
            answer = self.browser.get(path)
            return answer.json() if answer.status_code == 200 else {}
        except (httpx.HTTPError, ValueError):
            return {}

    def summary(self) -> dict[str, Any]:
        """Return the page's summary; empty if it does not answer."""
        found: dict[str, Any] = self.get("/api/summary")
        return found

    def status(self) -> dict[str, Any]:
        return self.summary().get("status") or {}

    def new_link(self) -> str:
        """Return a link to sign another page in, as each link works once."""
        links = self.until("another link", lambda: self._links()[1:])
        return links[-1]

    def _links(self) -> list[str]:
        return LINK.findall("".join(self.lines))

    def arm(self) -> None:
        """Wait until the vehicle may be armed, and arm it."""
        # The status also counts: an answer may take longer than its caller waits.
        self.until("the checks", lambda: (self.summary().get("preflight") or {}).get("ready"))
        self.until("arming", lambda: self.does("arm") or self.status().get("armed"))
        self.until("motors on", lambda: self.status().get("armed"))

    def take_off(self, **arguments: float) -> None:
        """Arm and take off; return when the vehicle is on its way."""
        self.arm()
        self.until(
            "take-off",
            lambda: self.starts("take_off", **arguments) or self.status().get("airborne"),
        )

    def is_down(self) -> bool:
        status = self.status()
        return bool(status) and not status["armed"]

    def starts(self, name: str, **arguments: Any) -> bool:
        """Return whether the vehicle begins this behavior."""
        return self.does("start_behavior", name=name, arguments=arguments)

    def does(self, command: str, /, **body: Any) -> bool:
        """Return whether a command is obeyed."""
        try:
            answer = self.browser.post(f"/api/commands/{command}", json=body)
        except httpx.HTTPError:
            return False
        return answer.status_code == 200

    def close(self) -> None:
        """End it by Ctrl-C. Raises QuadlabError when it does not end."""
        if self.up.poll() is None:
            self.up.send_signal(signal.SIGINT)
        try:
            self.up.wait(120)
        except subprocess.TimeoutExpired:
            self.up.kill()
            self.up.wait()
            raise QuadlabError("`quadlab up` did not end: " + self.last_lines()) from None
        finally:
            self.browser.close()
