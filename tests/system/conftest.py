"""Whole laboratory for tests: `quadlab up` with real processes on free loopback ports."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any, TypeVar

import httpx
import pytest

from vehicle_link import clock

T = TypeVar("T")
PATIENCE = 60.0
GAIN = "control.position.kp_xy"
PASSED = pytest.StashKey[bool]()


def free_ports(count: int) -> list[int]:
    """Return ports that are free for TCP and UDP on loopback now."""
    found: list[int] = []
    while len(found) < count:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_STREAM) as tcp,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
        ):
            tcp.bind(("127.0.0.1", 0))
            port = tcp.getsockname()[1]
            try:
                udp.bind(("127.0.0.1", port))
            except OSError:
                continue
            found.append(port)
    return found


def until(what: str, look: Callable[[], T | bool | None], patience: float = PATIENCE) -> T:
    """Return the first true result of `look`, called repeatedly; fail after `patience` seconds."""
    waited = threading.Event()
    end = time.monotonic() + patience
    while time.monotonic() < end:
        found = look()
        if found:
            return found  # type: ignore[return-value]
        waited.wait(0.1)  # each look takes two processes some milliseconds
    raise AssertionError(f"waited {patience:.0f} s for {what} in vain")


class Laboratory:
    """One `quadlab up` and a signed-in browser without a screen."""

    def __init__(self, data: Path, *words: str) -> None:
        self.data = data
        self.port, self.link_port = free_ports(2)
        self.lines: list[str] = []
        self._used: set[str] = set()
        self._gains: dict[str, Any] = {}
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "quadlab",
                "up",
                "--no-browser",
                "--data",
                str(data),
                "--port",
                str(self.port),
                "--link-port",
                str(self.link_port),
                *words,
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.url = f"http://127.0.0.1:{self.port}"
        self.browser = httpx.Client(base_url=self.url, headers={"origin": self.url}, timeout=10)

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.append(line.rstrip())

    def now(self) -> float:
        """Return the flight's clock, epoch in s, which stamps its logs: simulated time."""
        child = next(iter(self.processes()))
        environment = (Path("/proc") / str(child) / "environ").read_bytes().decode().split("\0")
        path = dict(one.partition("=")[::2] for one in environment)[clock.VARIABLE]
        clock.follow(path)
        try:
            return clock.time_ns() * 1e-9
        finally:
            clock.follow(None)

    @property
    def output(self) -> str:
        return "\n".join(self.lines)

    def link(self) -> str:
        """Return a printed link that has not been used; each use prints a new one."""

        def newest() -> str:
            links = re.findall(r"http://\S+token=\S+", self.output)
            return links[-1] if links and links[-1] not in self._used else ""

        found = until("a sign-in link", newest, 2 * PATIENCE)
        self._used.add(found)
        return found

    def sign_in(self) -> Laboratory:
        token = self.link().partition("token=")[2]
        answer = self.browser.post("/login", data={"token": token})
        assert answer.status_code == 200, answer.text
        return self

    def left_alone(self) -> None:
        """Wait for a signed-in laboratory without a commander, with the gains of its start."""
        if not self.browser.cookies:
            self.sign_in()
        until(
            "nobody to have control",
            lambda: (self.summary().get("control") or {}).get("holder") == "",
        )
        until("the vehicle's parameters", lambda: GAIN in self._control_gains())
        now = self._control_gains()
        self._gains = self._gains or now
        changed = {name: value for name, value in self._gains.items() if now[name] != value}
        if changed:
            answer = self.browser.put("/api/parameters", json={"values": changed})
            assert answer.status_code == 200, answer.text

    def _control_gains(self) -> dict[str, Any]:
        listed = self.get("/api/parameters")["parameters"]
        return {p["name"]: p["value"] for p in listed if p["name"].startswith("control.")}

    # ------------------------------------------------------------------ the page's API
    def get(self, path: str) -> Any:
        answer = self.browser.get(path)
        assert answer.status_code == 200, f"{path}: {answer.status_code} {answer.text}"
        return answer.json()

    def summary(self) -> dict[str, Any]:
        try:
            answer = self.browser.get("/api/summary")
        except httpx.TransportError:
            return {}
        return answer.json() if answer.status_code == 200 else {}

    def status(self) -> dict[str, Any]:
        return self.summary().get("status") or {}

    def command(self, command: str, /, **body: Any) -> httpx.Response:
        return self.browser.post(f"/api/commands/{command}", json=body)

    def do(self, command: str, /, **body: Any) -> None:
        answer = self.command(command, **body)
        assert answer.status_code == 200, f"{command}: {answer.text}"

    def start(self, behavior: str, **arguments: Any) -> None:
        self.do("start_behavior", name=behavior, arguments=arguments)

    def reach(self, patience: float = PATIENCE, **wanted: Any) -> None:
        """Wait until the status shows these values."""
        try:
            until(str(wanted), lambda: wanted.items() <= self.status().items(), patience)
        except AssertionError as error:
            raise AssertionError(f"{error}; status {self.status()}\n{self.output}") from None

    def ready(self) -> None:
        """Wait until the pre-flight checks allow arming."""

        def listed() -> dict[str, Any]:
            found: dict[str, Any] = self.summary().get("preflight") or {}
            return found

        self.reach(mode="ready")
        try:
            until("the pre-flight checks", lambda: listed().get("ready"))
        except AssertionError as error:
            raise AssertionError(f"{error}: {listed()}\n{self.output}") from None

    def hover(self, height: float = 1.0) -> None:
        """Arm and take off, faster than people do."""
        self.ready()
        until("arming", lambda: self.command("arm").status_code == 200, 20)
        self.reach(mode="armed")
        until(
            "take-off",
            lambda: (
                self.command(
                    "start_behavior", name="take_off", arguments={"height": height, "speed": 1.0}
                ).status_code
                == 200
            ),
            20,
        )
        self.reach(behavior="hover")

    # ------------------------------------------------------------------ processes
    def pid(self, command: str) -> int | None:
        """Return the process id of `quadlab <command>`, or of the vehicle's `vehicle.<command>`."""
        for pid, words in self.processes().items():
            if words[1:4] == ["-m", "quadlab", command] or words[1:3] == [
                "-m",
                f"vehicle.{command}.process",
            ]:
                return pid
        return None

    def processes(self) -> dict[int, list[str]]:
        """Return the command lines of this laboratory's processes, except the parent's."""
        found = {}
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_bytes().decode().split("\0")
            except (OSError, UnicodeDecodeError):
                continue
            if int(folder.name) != self._process.pid and str(self.data) in " ".join(words):
                found[int(folder.name)] = words
        return found

    def kill(self, command: str) -> int:
        """Kill a process by signal 9, and return its process id."""
        pid = until(f"the {command} process", lambda: self.pid(command), 10)
        os.kill(pid, signal.SIGKILL)
        return pid

    @contextlib.contextmanager
    def nothing_restarted(self) -> Iterator[None]:
        """Stop the supervising process within the block: a killed process stays dead."""
        self._process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._process.send_signal(signal.SIGCONT)

    def restarted(self, command: str, dead: int) -> None:
        until(f"a new {command}", lambda: self.pid(command) not in (None, dead), 30)

    def runs(self) -> list[dict[str, Any]]:
        runs: list[dict[str, Any]] = self.get("/api/runs")
        return runs

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None

    def newest(self, folder: str) -> Path:
        """Return the newest run or log in `runs` or `onboard`."""
        runs = [path.parent for path in (self.data / folder).glob("*/station.mcap")]
        return max([*(self.data / folder).glob("*.mcap"), *runs], key=lambda path: path.name)

    def wait(self, patience: float = PATIENCE) -> int:
        """Return the exit status of a laboratory that ends by itself."""
        status = self._process.wait(patience)
        self._reader.join(5.0)
        return status

    def stop(self, patience: float = PATIENCE) -> int:
        """Send Ctrl-C, and return the exit status."""
        self._process.send_signal(signal.SIGINT)
        try:
            return self._process.wait(patience)
        except subprocess.TimeoutExpired:
            self._process.kill()
            raise AssertionError(f"up did not end within {patience:.0f} s\n{self.output}") from None

    def close(self) -> None:
        print(self.output)  # pytest shows it if the test failed
        self.browser.close()
        if self._process.poll() is None:
            self.stop()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the tests of the shared laboratory last, and of these the one that ends it."""
    items.sort(
        key=lambda item: (
            "lab" in getattr(item, "fixturenames", ()),
            item.path.name == "test_shutdown.py",
        )
    )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.when == "call":
        item.stash[PASSED] = report.passed
    return report


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Laboratory]]:
    """Yield the list of the shared laboratory, which has none or one."""
    running: list[Laboratory] = []
    yield running
    for laboratory in running:
        laboratory.close()


@pytest.fixture
def lab(
    request: pytest.FixtureRequest,
    shared: list[Laboratory],
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Laboratory]:
    """Yield a signed-in laboratory without a commander.

    Tests share it, because a start takes as long as a flight. After a failed test it is a new one.
    """
    if not shared:
        shared.append(Laboratory(tmp_path_factory.mktemp("laboratory") / "data"))
    laboratory = shared[-1]
    request.node.stash[PASSED] = False
    try:
        laboratory.left_alone()
        yield laboratory
    finally:
        if laboratory.ended or not request.node.stash[PASSED]:
            shared.clear()
            laboratory.close()


@pytest.fixture(name="until")
def until_fixture() -> Callable[..., Any]:
    """Return `until(what, look, patience)`."""
    return until
