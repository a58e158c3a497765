"""A real flight process with the benchmark as comms process, which commands it and reads ticks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

import msgspec
import numpy as np
import numpy.typing as npt

from quadrotor.checkout import ROOT
from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.modes import Mode
from vehicle.processes.config import VehicleConfig, create_rings, open_rings

STEP_S = 0.01
NICENESS = -10
HEARTBEAT_NS = 50_000_000
ANSWER_S = 3.0
Notes = dict[str, npt.NDArray[np.int64]]
"""The arrays written by benchmarks.onboard.recorded_flight, by name."""


class FlightUnderTest:
    """A flight process that notes its ticks; use it in a `with` statement.

    Args:
        folder: for its notes.
        rate: Hz.
        ports: serial devices; none for a simulated vehicle inside the process.
        poses: called often, returns the poses that a tracking system has measured since the last
            call.
    """

    def __init__(
        self,
        folder: Path,
        rate: int,
        ports: Sequence[str] = (),
        poses: Callable[[], list[Record]] = list,
    ) -> None:
        self._out = folder / f"flight{rate}.npz"
        self._poses = poses
        self._descriptors = create_rings()
        self._rings = open_rings(self._descriptors)
        self._config = VehicleConfig(
            parent=os.getpid(), rings=self._descriptors, ports=list(ports), rate=rate
        )
        self._replies: dict[str, mailbox.Reply] = {}
        self._asked = 0
        self._heartbeat_ns = 0
        self.events: list[str] = []
        self.newest: Record | None = None
        self.heard: Callable[[Record], None] = lambda ticks: None
        """Called with all ticks read, shape (N,)."""

    def __enter__(self) -> FlightUnderTest:
        with suppress(PermissionError):  # as `quadlab up` starts its flight processes
            os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
        words = msgspec.json.encode(self._config).decode()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.onboard.recorded_flight", words, str(self._out)],
            cwd=ROOT,
            pass_fds=self._descriptors.all,
        )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        for descriptor in self._descriptors.all:
            os.close(descriptor)

    @property
    def rights(self) -> str:
        """Return the scheduling of the process, and how much of its memory is locked."""
        policy = os.sched_getscheduler(self._process.pid)
        name = "SCHED_FIFO" if policy == os.SCHED_FIFO else "not real time"
        status = Path(f"/proc/{self._process.pid}/status").read_text().splitlines()
        locked = next(line.split()[1] for line in status if line.startswith("VmLck"))
        return f"{name}, {int(locked) // 1024} MB locked"

    def fly(self, seconds: float) -> None:
        """Serve the process for this time. Raises QuadlabError when it ends."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._serve()
            time.sleep(STEP_S)

    def until(self, mode: Mode, longest: float) -> None:
        """Serve the process until it is in this mode. Raises QuadlabError."""
        end = time.monotonic() + longest
        while self.newest is None or self.newest["status"]["mode"][0] != mode:
            if time.monotonic() > end:
                raise QuadlabError(f"not {mode.name.lower()} in {longest:.0f} s: {self.events}")
            self.fly(STEP_S)

    def take_off(self) -> None:
        """Take off and start the figure 8, which continues."""
        self.until(Mode.READY, 120.0)
        self.fly(1.0)
        self.ask(lambda id: mailbox.Arm(id, "benchmark"))
        self.fly(1.0)
        self.start("take_off", height=1.0)
        self.fly(6.0)
        self.start("follow_trajectory", trajectory="figure_eight", laps=100)
        self.fly(2.0)

    def start(self, behavior: str, **arguments: float | str) -> None:
        self.ask(lambda id: mailbox.StartBehavior(id, "benchmark", behavior, dict(arguments)))

    def ask(self, command: Callable[[str], mailbox.Command]) -> None:
        """Send a command and wait for its acceptance. Raises RefusedError."""
        self._asked += 1
        request = str(self._asked)
        self._rings.inbox.push(mailbox.encode(command(request)))
        end = time.monotonic() + ANSWER_S
        while request not in self._replies:
            if time.monotonic() > end:
                raise RefusedError("the flight process does not answer")
            self.fly(STEP_S)
        reply = self._replies[request]
        if not reply.accepted:
            raise RefusedError(reply.reason)

    def stop(self) -> Notes:
        """End the process as its parent would; return its notes."""
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(10.0)
        with np.load(self._out) as notes:
            return {name: notes[name] for name in notes.files}

    def _serve(self) -> None:
        if self._process.poll() is not None:
            raise QuadlabError(f"the flight process ended: {self.events}")
        ticks = self._rings.ticks.pop_all()
        if len(ticks):
            self.newest = ticks[-1:]
            self.heard(ticks)
        for message in self._rings.outbox.pop_all():
            told = mailbox.decode_outbound(message)
            if isinstance(told, mailbox.Reply):
                self._replies[told.request_id] = told
            elif isinstance(told, mailbox.Event):
                self.events.append(told.text)
        for pose in self._poses():
            self._rings.poses.push(pose)
        now_ns = time.time_ns()
        if self.newest is not None and now_ns - self._heartbeat_ns > HEARTBEAT_NS:
            self._heartbeat_ns = now_ns
            stamp_ns = int(self.newest["imu"]["stamp_ns"][0])
            self._rings.inbox.push(mailbox.encode(mailbox.Heartbeat(stamp_ns)))
