"""Flights of real processes in real time in which one is killed, frozen or unplugged.

Simulator and vehicle are started again for each flight, so that the seed's truth begins at the
origin. Where the station or the page fails, a real station and web process run too; otherwise this
process is the station: it sends heartbeats and the tracker's poses and calls the services.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.flights.failing_flights import CORRUPTED, CORRUPTED_FOR, DRAG, SETTINGS, conditions
from benchmarks.flights.failing_ground import NAME, Ground, NotFlownError, until
from benchmarks.flights.touch_down import TOUCHING, Outcome, TouchDown
from benchmarks.harness import free_port
from flight_log.index import is_closed
from quadrotor.checkout import ROOT
from quadrotor.errors import LinkError
from quadrotor.motor_state import MotorState
from vehicle_link.serial.commands import decode_data
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.serial.ids import MIRROR, Id
from vehicle_link.serial.serial_port import SerialPort

FAILURES = (
    "web",
    "station",
    "comms",
    "flight",
    "frozen",
    "port 0",
    "port 1",
    "both ports",
    CORRUPTED,
)
STARTS = ("hover 1 m", "hover 2 m", "hover 3 m", "figure 8")
WITH_STATION = ("web", "station")
UNPLUGGED = {"port 0": "first", "port 1": "second", "both ports": "both"}
TRIES = 3
STILL_S = 2.0
"""Time at rest on the ground, in s, that ends a flight without a report of motors off."""


class Processes:
    """The real processes of one flight."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self._folder = folder
        self._output = stack.enter_context((folder / "output").open("ab"))
        self._started: dict[str, subprocess.Popen[bytes]] = {}
        stack.callback(self._stop)

    def start(self, command: str, *words: str) -> None:
        self._started[command] = subprocess.Popen(
            [sys.executable, "-m", "quadlab", command, *words],
            cwd=ROOT,
            stdout=self._output,
            stderr=self._output,
            stdin=subprocess.DEVNULL,
        )

    def output(self) -> str:
        return (self._folder / "output").read_text(errors="replace")

    def signal(self, which: str, number: int) -> int:
        """Send a signal to a started process, or to one of the vehicle's two; return its id."""
        pid = self._started[which].pid if which in self._started else self._child(which)
        os.kill(pid, number)
        return pid

    def ended(self, command: str) -> bool:
        return self._started[command].poll() is not None

    def _child(self, which: str) -> int:
        vehicle = self._started["vehicle"].pid
        children = Path(f"/proc/{vehicle}/task/{vehicle}/children").read_text().split()
        for pid in children:
            if f"vehicle.{which}.process".encode() in Path(f"/proc/{pid}/cmdline").read_bytes():
                return int(pid)
        raise NotFlownError(f"the vehicle has no {which} process")

    def _stop(self) -> None:
        for process in reversed(self._started.values()):
            if process.poll() is None:
                process.terminate()
        for process in self._started.values():
            try:
                process.wait(15.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def fly_real(failure: str, start: str, seed: int) -> Outcome:
    """Fly once with a failure; return the outcome.

    A flight that does not reach its failure, on a machine that stalled for a quarter of a second
    for instance, is started again, which is reported.
    """
    for _ in range(TRIES - 1):
        outcome = _fly_once(failure, start, seed)
        if outcome.broken or not outcome.why:
            return outcome
        print(f"not flown as far as the failure: {outcome.why}", file=sys.stderr, flush=True)
    return _fly_once(failure, start, seed)


def _fly_once(failure: str, start: str, seed: int) -> Outcome:
    outcome = Outcome(failure, start, seed)
    with tempfile.TemporaryDirectory(prefix="quadlab-failures-") as folder, ExitStack() as stack:
        processes = Processes(stack, Path(folder))
        try:
            ground = _set_up(stack, processes, Path(folder), failure, seed)
            _fail(ground, processes, Path(folder), outcome)
        except (NotFlownError, LinkError, OSError) as error:
            lines = processes.output().splitlines()[-3:]
            outcome.why = f"{error} ({' | '.join(lines)})"
    return outcome


def _set_up(
    stack: ExitStack, processes: Processes, folder: Path, failure: str, seed: int
) -> Ground:
    """Start everything."""
    link_port, real_station = free_port(), failure in WITH_STATION
    ground = Ground(stack, folder, link_port, real_station)
    truth = {"seed": seed, "drag": DRAG, **conditions(seed)}
    words = [word for name, value in truth.items() for word in ("--set", f"{name}={value}")]
    processes.start(
        "simulator",
        "--folder",
        str(folder),
        "--loopback-port",
        str(ground.truth_port),
        "--name",
        NAME,
        *words,
    )
    settings = [word for name, value in SETTINGS.items() for word in ("--set", f"{name}={value}")]
    processes.start(
        "vehicle",
        "--serial",
        str(folder / "mcu0"),
        str(folder / "mcu1"),
        "--data",
        str(folder),
        "--link-port",
        str(link_port),
        "--name",
        NAME,
        *settings,
    )
    if real_station:
        loopback = ("--loopback-port", str(ground.station_port), "--name", NAME)
        processes.start(
            "station", "--data", str(folder), "--vehicle", f"127.0.0.1:{link_port}", *loopback
        )
        processes.start("web", "--data", str(folder), "--port", str(free_port()), *loopback)
    return ground


def _fail(ground: Ground, processes: Processes, folder: Path, outcome: Outcome) -> None:
    failure, start = outcome.failure, outcome.start
    chance = np.random.default_rng((outcome.seed, FAILURES.index(failure), STARTS.index(start)))
    until("the vehicle to be ready", lambda: ground.told(mode="ready"))
    ground.do("arm")
    until("motors on", lambda: ground.told(mode="armed"))
    height = float(start.split()[1]) if start.startswith("hover") else 1.0
    ground.start("take_off", height=height)
    until("hover", lambda: ground.told(behavior="hover"))
    if start == "figure 8":
        ground.start("follow_trajectory", trajectory="figure_eight", laps=5)
        time.sleep(4.0)
    time.sleep(float(chance.uniform(0.5, 8.0 if start == "figure 8" else 2.0)))

    if not ground.told(mode="armed", airborne=True, control_mode="direct"):
        raise NotFlownError(f"it is not in the air any more: {ground.status}")
    begun = ground.stamp
    watch = TouchDown(outcome, begun, ground.truth["position_w"][0].tolist())
    still = [math.nan]

    def see(stamp: float, state: Any) -> None:
        truth = state[0]
        position = truth["position_w"].tolist()
        watch.note(stamp, position, float(truth["velocity_w"][2]), truth["quaternion_wb"].tolist())
        resting = position[2] < TOUCHING and np.abs(truth["velocity_w"]).max() < 0.02
        still[0] = (still[0] if still[0] <= stamp else stamp) if resting else math.nan

    ground.watch = see
    wall = time.monotonic()
    outcome.broken = True
    break_it(ground, processes, failure)
    time.sleep(CORRUPTED_FOR if failure == CORRUPTED else 2.0)
    if failure in ("web", "comms", CORRUPTED):  # comms restarts by itself
        until("the vehicle to be heard", ground.told)
        if ground.told(mode="armed"):
            ground.start("land")
        elif failure != "comms":
            raise NotFlownError(f"it did not fly on: {ground.status}")
    alone = failure in ("station", "flight", "frozen", "both ports")
    if not alone:
        until("motors off", lambda: ground.told(armed=False))
        outcome.off = time.monotonic() - wall
    else:
        until("rest on the ground", lambda: ground.stamp - still[0] > STILL_S)
        outcome.off = _when_off(ground, processes, folder, failure, wall)
    ground.watch = lambda *_: None


def break_it(ground: Ground, processes: Processes, failure: str) -> None:
    """Cause the failure itself."""
    if failure == "frozen":
        processes.signal("flight", signal.SIGSTOP)
    elif failure == CORRUPTED:
        ground.change_simulator(corrupted_bytes=0.05)
    elif failure in UNPLUGGED:
        ground.change_simulator(unplugged_port=UNPLUGGED[failure])
    else:
        processes.signal(failure, signal.SIGKILL)


def _when_off(
    ground: Ground, processes: Processes, folder: Path, failure: str, wall: float
) -> float:
    """Return the latest time (s) by which the motors were off.

    The microcontroller is asked, or the vehicle if it responds.
    """
    if failure == "frozen":
        processes.signal("flight", signal.SIGCONT)
        until("motors off", lambda: ground.told(armed=False), 15.0)
        return time.monotonic() - wall
    if failure == "station":
        # The vehicle closes its log when it has disarmed.
        logs = list((folder / "onboard").glob("*.mcap"))
        until("motors off", lambda: any(is_closed(log) for log in logs), 15.0)
        return time.monotonic() - wall
    until("the end of the vehicle", lambda: processes.ended("vehicle"), 15.0)
    if failure == "both ports":
        ground.change_simulator(unplugged_port="none")
    until("motors off", lambda: _off(folder), 15.0)
    return time.monotonic() - wall


def _off(folder: Path) -> bool:
    """Return whether the microcontroller reports at its first port that its motors are off."""
    try:
        port = SerialPort(folder / "mcu0")
    except LinkError:
        return False
    decoder, end = FrameDecoder(), time.monotonic() + 0.5
    state = MIRROR.index(Id.MOTOR_STATE)
    try:
        while time.monotonic() < end:
            time.sleep(0.02)
            for frame in decoder.feed(port.read()):
                values = decode_data(frame)
                if values is not None:
                    return values[state] in (MotorState.OFF, MotorState.INIT)
    except LinkError:
        pass
    finally:
        port.close()
    return False
