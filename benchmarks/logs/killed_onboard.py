"""The vehicle's comms process killed (-9) at random moments while it writes the onboard log.

    python -m benchmarks killed_logs [--quick]

The real `vehicle.comms.process`, with its link, is started again after each kill as its parent
does; this process is the flight process, 500 ticks a second through the shared ring. A tick is lost
if neither the dead process's file nor that of the next one has it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.harness import free_port
from benchmarks.logs.killed_file import Kill, problems_of
from benchmarks.onboard.flight_under_test import NICENESS
from flight_log.index import is_closed
from flight_log.reader import read_log
from flight_log.tick_columns import TICK_TOPICS
from quadrotor.checkout import ROOT
from quadrotor.parameters import ParameterStore
from quadrotor.records import TICK
from vehicle import mailbox
from vehicle.onboard_log.repair import FOLDER, recover_logs, torn_logs
from vehicle.parameters import new_parameters
from vehicle.processes.config import RingDescriptors, Rings, VehicleConfig, create_rings, open_rings
from vehicle.processes.rings import READ
from vehicle_link.security.authority import ensure_certificates

RATE = 500
STEP_NS = 1_000_000_000 // RATE
EARLIEST_S, LATEST_S = 0.3, 2.5
PATIENCE_S = 60.0
WAITING_MAX = 2000  # ticks in the ring
NAME = "quad1"


def kills(count: int, seed: int = 1) -> Iterator[Kill]:
    """Yield `count` kills in one flight, each at a random moment."""
    chance = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory(prefix="quadlab-killed-") as name:
        data = Path(name)
        ensure_certificates(data / "certificates")
        descriptors = create_rings()
        flight = Flight(open_rings(descriptors))
        try:
            died: Dead | None = None
            for _ in range(count):
                after_s = float(chance.uniform(EARLIEST_S, LATEST_S))
                log = _run(data, descriptors, signal.SIGKILL, after_s)
                now_dead = _dead(data, log, flight)
                if died is not None:
                    yield _kill(died, now_dead.first)
                died = now_dead
            log = _run(data, descriptors, signal.SIGTERM, EARLIEST_S)
            if died is not None:
                yield _kill(died, _numbers(log, flight)["imu"][0])
        finally:
            flight.end()
            for descriptor in descriptors.all:
                os.close(descriptor)


@dataclass(frozen=True)
class Dead:
    """The remains of one killed process; ticks by number."""

    taken: int  # from the ring
    first: int  # in its file
    last: int
    problems: tuple[str, ...]


class Flight:
    """Flight process that is armed, with incompressible numbers; `ticks` runs in a thread."""

    def __init__(self, rings: Rings) -> None:
        self._rings = rings
        self._ended = threading.Event()
        self._values = ParameterStore(new_parameters()).values()
        self._thread = threading.Thread(target=self._run)
        self.start_ns = time.time_ns()
        self._thread.start()

    def end(self) -> None:
        self._ended.set()
        self._thread.join()

    @property
    def taken(self) -> int:
        """Return the number of ticks that comms has read."""
        return int(self._rings.ticks._words[READ])

    def _run(self) -> None:
        random = np.random.default_rng(1)
        tick, number = np.zeros(1, TICK), 0
        tick["state"]["quaternion_wb"][:, 0] = 1.0
        tick["status"]["armed"], tick["status"]["tick_rate"] = 1, RATE
        while not self._ended.is_set():
            tick["sequence"] = number
            tick["imu"]["stamp_ns"] = self.start_ns + STEP_NS * number
            tick["state"]["position_w"] = random.normal(size=(1, 3))
            tick["imu"]["specific_force_b"] = random.normal(size=(1, 3))
            while len(self._rings.ticks) > WAITING_MAX and not self._ended.is_set():
                self._answer()
                time.sleep(0.01)  # comms is still starting: no tick may be missing
            self._rings.ticks.push(tick)
            number += 1
            self._answer()
            time.sleep(max(0.0, 1e-9 * (self.start_ns + STEP_NS * number - time.time_ns())))

    def _answer(self) -> None:
        for message in self._rings.inbox.pop_all():
            asked = msgspec.msgpack.decode(message, type=mailbox.Inbound)
            if isinstance(asked, mailbox.ChangeParameters):
                reply = mailbox.Reply(asked.request_id, True, applied=self._values)
                self._rings.outbox.push(mailbox.encode(reply))


def _run(data: Path, descriptors: RingDescriptors, ending: signal.Signals, after_s: float) -> Path:
    """Run until `after_s` after its file exists; return that file."""
    folder = data / FOLDER
    before = set(folder.glob("*.mcap"))
    config = VehicleConfig(
        parent=os.getpid(), rings=descriptors, name=NAME, data=str(data), link_port=free_port()
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "vehicle.comms.process", msgspec.json.encode(config).decode()],
        cwd=ROOT,
        pass_fds=descriptors.all,
        stdin=subprocess.DEVNULL,
    )
    with suppress(PermissionError):  # as `quadlab up` starts its flight processes
        os.setpriority(os.PRIO_PROCESS, process.pid, NICENESS)
    try:
        end = time.monotonic() + PATIENCE_S
        while not set(folder.glob("*.mcap")) - before:
            if process.poll() is not None:
                raise RuntimeError(f"the comms process ended with status {process.returncode}")
            if time.monotonic() > end:
                raise RuntimeError(f"the comms process logs nothing within {PATIENCE_S:.0f} s")
            time.sleep(0.01)
        time.sleep(after_s)
        process.send_signal(ending)
        process.wait(PATIENCE_S)
    finally:
        process.kill()
        process.wait()
    [log] = set(folder.glob("*.mcap")) - before
    return log


def _dead(data: Path, log: Path, flight: Flight) -> Dead:
    """Repair the log as the next start does, and check what is left."""
    taken = flight.taken
    problems = ["it was closed before it was killed"] if is_closed(log) else []
    problems += [line for line in recover_logs(torn_logs(data)) if "not recovered" in line]
    numbers = _numbers(log, flight)
    ticks = numbers["imu"]
    for topic in TICK_TOPICS:
        if numbers[topic] != list(range(ticks[0], ticks[-1] + 1)):
            problems.append(f"{topic}: what is left is not every tick up to its end")
    if not {"status", "estimator", "battery", "pressure"} <= set(numbers):
        problems.append("topics next to those of every tick are missing")
    problems += problems_of(log, sum(map(len, numbers.values())))
    return Dead(taken, ticks[0], ticks[-1], tuple(problems))


def _kill(dead: Dead, next_first: int) -> Kill:
    missing = max(0, next_first - dead.last - 1)
    put, kept = dead.taken - dead.first, dead.last - dead.first + 1
    return Kill(put, kept, missing * STEP_NS * 1e-6, dead.problems)


def _numbers(log: Path, flight: Flight) -> dict[str, list[int]]:
    """Return the numbers of each topic's messages; for ticks, those of the flight."""
    found: dict[str, list[int]] = {}
    for message in read_log(log):
        number = (message.publish_ns - flight.start_ns) // STEP_NS
        found.setdefault(message.topic.rsplit("/", 1)[-1], []).append(number)
    return found
