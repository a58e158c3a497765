"""The simulated vehicle on two pseudo-terminals (`quadlab simulator`).

Time: sample k is sampled at start + k / rate on the monotonic clock and takes 3 ms on the line. In
real time that is the computer's clock, in lockstep (`vehicle.simulator.lockstep`) the simulation's,
which waits for the processes that must follow. Truth is stamped with the host's epoch time at the
start plus k / rate; the vehicle stamps the same sample with its own estimate of the same constant
(vehicle.boards.mikrokopter.clock), so the two agree to within the least delay of a sample, well
below 2 ms, as long as both run on one host.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.lockstep import LockstepPace
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.robot import SECOND_NS, Pace, Robot, RunStatistics, Served, pace_of
from vehicle.simulator.simulated_vehicle import PERIOD_MAX_US, SimulatedVehicle
from vehicle_link import clock
from vehicle_link.transport.loopback import SharedSession

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session

PRIORITY = 40
"""SCHED_FIFO, below the flight process: late samples would look like a late flight loop."""
TOGETHER_NS = 200_000
"""Time, in ns, within which due steps of several vehicles are made together."""
ROW, APART = 4, 1.0
"""Number of vehicles in a row on the floor, and their distance in m."""
MIN_PAUSE_S = 0.0004
"""Least pause, in s, between two steps when behind, for the flight stack to answer each sample."""
GIVE_UP_NS = 1_000_000_000
"""Delay, in ns, from which samples are skipped, not caught up: the machine was suspended."""


def run(
    parameters: SimulatorParameters,
    folder: Path,
    loopback_port: int | None,
    *,
    vehicles: Sequence[str] = ("quad1",),
    stop: threading.Event | None = None,
    served: Served | None = None,
    firmware: Callable[[int], BoardFirmware | None] = lambda _: None,
    is_asked: bool = False,
) -> RunStatistics:
    """Run until `stop` is set, or without one until SIGTERM or SIGINT.

    Args:
        parameters: of one vehicle; with several, each gets its own place and noise.
        folder: where the links `mcu0` and `mcu1` to the serial devices are made; with several
            vehicles, in a folder of the vehicle's name.
        loopback_port: of the station's router; None publishes no truth.
        served: tracking systems that receive the truth; closed at the end.
        firmware: returns the firmware of a vehicle by its number from 0; None: the simulator's own.
        is_asked: whether the board gives samples only on request.

    Raises StorageError when the links cannot be made.
    """
    stop = stop or _stop_on_signals()
    # Before the devices exist: a device means that the microcontroller is switched on.
    SimulatedVehicle(parameters).warm_up()
    pace = pace_of(len(vehicles))
    lockstep = _lockstep(vehicles, pace, is_asked)
    session = None if loopback_port is None else SharedSession(partial(_open, loopback_port))
    robots: list[Robot] = []
    try:
        truths = side_by_side(parameters, len(vehicles))
        for number, (truth, name) in enumerate(zip(truths, vehicles, strict=True)):
            place = _place(folder, name, vehicles)
            robots.append(
                Robot(
                    name,
                    truth,
                    folder=place,
                    session=session,
                    pace=pace,
                    lockstep=lockstep,
                    served=served,
                    firmware=firmware(number),
                )
            )
        refusal = _ask_for_priority()
        shown = refusal if lockstep is None else ", in lockstep"
        _say(f"{_where(robots[0], vehicles, folder)}, {parameters.imu_rate} Hz{shown}")
        gc.collect()
        gc.freeze()
        return _run(robots, stop, lockstep)
    finally:
        for part in (*robots, lockstep, served):
            if part is not None:
                part.close()


def _run(
    robots: Sequence[Robot], stop: threading.Event, lockstep: LockstepPace | None
) -> RunStatistics:
    statistics = RunStatistics()
    if lockstep is None:
        _loop(robots, statistics, stop)
    else:
        _loop_in_lockstep(robots, statistics, stop, lockstep)
    for robot in robots:
        robot.add_to(statistics)
    return statistics


def _where(first: Robot, vehicles: Sequence[str], folder: Path) -> str:
    """Return which microcontrollers are where, for the first line."""
    if len(vehicles) == 1:
        return f"microcontroller at {first.place}"
    return f"microcontrollers of {', '.join(vehicles)} in {folder}"


def _place(folder: Path, name: str, vehicles: Sequence[str]) -> Path:
    """Return the folder of a vehicle's links, made if it has one of its own."""
    place = folder if len(vehicles) == 1 else folder / name
    place.mkdir(exist_ok=True)
    return place


def _lockstep(vehicles: Sequence[str], pace: Pace, is_asked: bool) -> LockstepPace | None:
    """Return the lockstep if `quadlab up` created a page of the clock, else None for real time."""
    page = clock.page()
    if page is None:
        return None
    step_ns = 1000 * PERIOD_MAX_US * pace.periods
    steps = 1 + -(-SECOND_NS // (pace.truth_rate * step_ns))
    return LockstepPace(page, vehicles, steps * step_ns, _say, is_asked=is_asked)


def _loop(robots: Sequence[Robot], statistics: RunStatistics, stop: threading.Event) -> None:
    for robot in robots:
        robot.begin(clock.time_ns(), time.monotonic_ns())
    while not stop.is_set():
        due_ns = min(robot.due_ns for robot in robots)
        wait_ns = due_ns - time.monotonic_ns()
        if wait_ns < -GIVE_UP_NS:
            lost = sum(robot.lose(-wait_ns) for robot in robots)
            statistics.lost_samples += lost
            _say(f"this machine stopped for {-wait_ns * 1e-9:.1f} s; {lost} samples are lost")
            continue
        time.sleep(max(wait_ns * 1e-9, MIN_PAUSE_S))
        _step(robots, due_ns, statistics)


def _loop_in_lockstep(
    robots: Sequence[Robot],
    statistics: RunStatistics,
    stop: threading.Event,
    lockstep: LockstepPace,
) -> None:
    start_ns = lockstep.begin()
    for robot in robots:
        robot.begin(clock.time_ns(), start_ns)
    due_ns = min(robot.due_ns for robot in robots)
    while not stop.is_set():
        lockstep.wait(due_ns, MIN_PAUSE_S, stop.is_set)
        _step(robots, due_ns, statistics)
        due_ns = min(robot.due_ns for robot in robots)
        lockstep.reach(due_ns)


def _step(robots: Sequence[Robot], due_ns: int, statistics: RunStatistics) -> None:
    """Step all vehicles that are due, in one wake-up."""
    for robot in robots:
        if robot.due_ns <= due_ns + TOGETHER_NS:
            robot.step()
            statistics.periods += 1


def side_by_side(parameters: SimulatorParameters, count: int) -> list[SimulatorParameters]:
    """Return the parameters of `count` vehicles in rows of four on the floor, 1 m apart.

    Each vehicle has its own noise.
    """
    if count == 1:
        return [parameters]
    rows = -(-count // ROW)
    columns = min(count, ROW)
    return [
        parameters.model_copy(
            deep=True,
            update={
                "seed": parameters.seed + number,
                "start_x": parameters.start_x + APART * (number % ROW - 0.5 * (columns - 1)),
                "start_y": parameters.start_y + APART * (number // ROW - 0.5 * (rows - 1)),
            },
        )
        for number in range(count)
    ]


def _open(loopback_port: int) -> Session:
    # Imported here: importing Zenoh takes a while, which the plant need not wait for.
    from vehicle_link.transport.loopback import loopback_session

    return loopback_session(loopback_port)


def _ask_for_priority() -> str:
    """Request SCHED_FIFO for this thread; return what to add to the first line when refused."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError as error:
        return f", not real time (SCHED_FIFO: {error.strerror}): samples come late under load"
    return ""


def _stop_on_signals() -> threading.Event:
    stop = threading.Event()

    def on_signal(number: int, frame: object) -> None:
        stop.set()

    signal.signal(signal.SIGTERM, on_signal)
    signal.signal(signal.SIGINT, on_signal)
    return stop


def _say(line: str) -> None:
    print(f"simulator: {line}", file=sys.stderr, flush=True)
