"""Flights in simulated time in which something above the microcontroller fails.

One flight per seed goes from hover at 1, 2 and 3 m over the figure 8 to the lap from rest to rest
that leans furthest, lands, and climbs again. At its own moment in each, it forks once for each
failure: the copy flies that failure to its end, and the flight itself continues. A board that is
another process (Betaflight) cannot be forked: there each failure has its own flight.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing.connection import Connection

import numpy as np

from benchmarks.flights.touch_down import Outcome, TouchDown
from benchmarks.flights.watched_flight import WatchedFlight
from quadrotor.errors import LinkError, QuadlabError
from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue
from vehicle.boards.kind import MIKROKOPTER
from vehicle_link.jobs import die_with_parent

STARTS = ("hover 1 m", "hover 2 m", "hover 3 m", "figure 8", "lap", "climb")
SILENT = "flight killed or frozen"
CORRUPTED = "5 % of the bytes"
FAILURES = ("station", "comms", SILENT, "port 0", "port 1", "both ports", CORRUPTED, "tracker")
SETTINGS: dict[str, ParameterValue] = {
    "behavior.trajectory_acceleration_max": 8.0,
    "behavior.trajectory_tilt_max": 45.0,
    "behavior.volume_z_max": 3.5,
}
"""Settings of the vehicle that allow the lap in 7 s, which leans by 35 degrees, and 3 m of height
from a ground that is not quite at 0."""
CORRUPTED_FOR = 15.0
"""Time, in s, flown with corrupted bytes before the landing, during which they continue."""
LONGEST = 45.0
"""Longest time, in s, from the failure to its end."""
BETAFLIGHT, CRAZYFLIE = "betaflight", "crazyflie"
DRAG, DRAG_OF_CRAZYFLIE = 0.25, 0.006
"""N s/m; relative to the mass they are equal, and so is what the wind does."""
LANDING_TIME = 12
"""Time, in s, after which Betaflight stops its motors; 20 by default, which only takes longer."""
Settings = Mapping[str, ParameterValue]
Flight = tuple[str, str, int]
"""Failure, start and seed of a flight."""


def conditions(seed: int, board: str = MIKROKOPTER) -> dict[str, ParameterValue]:
    """Return the truth of a seed: wind, gusts, motors, battery, drift of the gyroscope."""
    chance = np.random.default_rng((seed, 11))
    speed, heading = chance.uniform(0.0, 1.0), chance.uniform(-math.pi, math.pi)
    drift = chance.normal(0.0, 1.0, 3)
    return {
        "drag": DRAG_OF_CRAZYFLIE if board == CRAZYFLIE else DRAG,
        "wind_x": round(speed * math.cos(heading), 2),
        "wind_y": round(speed * math.sin(heading), 2),
        "gust": 0.5,
        "thrust_efficiency": round(chance.uniform(0.95, 1.05), 3),
        "battery_charge": round(chance.uniform(0.5, 1.0), 2),
        "gyroscope_bias_x": round(drift[0], 2),
        "gyroscope_bias_y": round(drift[1], 2),
        "gyroscope_bias_z": round(drift[2], 2),
    }


class FailingFlight(WatchedFlight):
    """A flight whose station can be silent and whose flight process can fail.

    Attributes:
        heard: whether the station's heartbeat and poses arrive.
    """

    heard = True

    def _station(self, now_ns: int) -> None:
        if self.heard:
            super()._station(now_ns)

    def lose_tracker(self) -> None:
        """Stop all pose measurements."""
        self._next_truth_ns = 10**18

    def advance(self) -> None:
        try:
            super().advance()
        except LinkError:  # the last port is lost: the flight process ends
            self.frozen = True


def fly_alone(failure: str, start: str, seed: int, board: str) -> list[Outcome]:
    """Fly one failure from one start under the conditions of a seed."""
    truth = {f"simulator.{name}": value for name, value in conditions(seed).items()}
    settings = truth | SETTINGS | {"board.landing_time": LANDING_TIME}
    outcome = Outcome(failure, start, seed, real=False)
    flight = FailingFlight(seed, settings, board=board)
    try:
        _bring_to(flight, STARTS[0])
        if start != STARTS[0]:
            _bring_to(flight, start)
        if start.startswith("hover"):
            flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=60)
        chance = np.random.default_rng((seed, 13, STARTS.index(start), FAILURES.index(failure)))
        flight.wait(float(chance.uniform(0.0, 8.0 if start == "figure 8" else 2.0)))
        outcome.broken = True
        watch_failure(flight, failure, outcome)
    except QuadlabError as error:
        outcome.why = str(error)
    finally:
        flight.robot.close()
    return [outcome]


def fly_seed(
    seed: int, failures: Sequence[str], starts: Sequence[str], settings: Settings, board: str
) -> list[Outcome]:
    """Fly all failures from all starts under the conditions of one seed, with these settings."""
    truth = {f"simulator.{name}": value for name, value in conditions(seed, board).items()}
    flight = FailingFlight(seed, {**settings, **truth, **SETTINGS}, board=board)
    chance = np.random.default_rng((seed, 13))
    outcomes: list[Outcome] = []
    for start in STARTS[: 1 + max(STARTS.index(start) for start in starts)]:
        _bring_to(flight, start)
        flight.wait(float(chance.uniform(0.0, 8.0 if start == "figure 8" else 2.0)))
        if start == "lap":
            flight.start(
                "follow_trajectory", trajectory="figure_eight_lap", period=7.0, yaw_amplitude=0.2
            )
            flight.wait(float(chance.uniform(1.0, 6.0)))
        moments = chance.uniform(0.0, 0.5, len(failures))
        if start in starts:
            for failure, moment in zip(failures, moments, strict=True):
                outcomes.append(_forked(flight, failure, start, seed, float(moment)))
    return outcomes


def _bring_to(flight: FailingFlight, start: str) -> None:
    if start == "hover 1 m":
        flight.hover(1.0)
        return
    if start == "climb":
        flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=60)
        flight.start("land")
        flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=60)
        flight.arm()
        flight.wait(1.0)
        flight.start("take_off", height=1.0)
        return
    if start.startswith("hover"):
        flight.start("fly_to", x=0.0, y=0.0, z=float(start.split()[1]), yaw=0.0)
    elif start == "figure 8":
        flight.start("fly_to", x=0.0, y=0.0, z=1.0, yaw=0.0)
        flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=30)
        flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
        flight.wait(4.0)
        return
    flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=60)
    flight.wait(1.0)


def _forked(flight: FailingFlight, failure: str, start: str, seed: int, moment: float) -> Outcome:
    """Return the outcome of a copy of the flight, `moment` (s) later; the flight is unchanged."""
    fork = multiprocessing.get_context("fork")
    here, there = fork.Pipe(duplex=False)
    arguments = flight, failure, start, seed, moment, there, os.getpid()
    copy = fork.Process(target=_fail, args=arguments)
    copy.start()
    there.close()
    try:
        found: Outcome = here.recv()
    except EOFError:
        found = Outcome(failure, start, seed, False, why="no outcome")
    copy.join()
    return found


def _fail(
    flight: FailingFlight,
    failure: str,
    start: str,
    seed: int,
    moment: float,
    told: Connection,
    parent: int,
) -> None:
    _follow(parent)
    outcome = Outcome(failure, start, seed, real=False)
    try:
        flight.wait(moment)
        outcome.broken = True
        chance = np.random.default_rng((seed, 17, FAILURES.index(failure)))
        watch_failure(flight, failure, outcome, outage=float(chance.uniform(0.3, 4.0)))
    except QuadlabError as error:
        outcome.why = str(error)
    told.send(outcome)


def watch_failure(
    flight: FailingFlight, failure: str, outcome: Outcome, outage: float = 1.0
) -> None:
    """Cause the failure now, and continue until it is down with its motors off.

    Args:
        outage: s until comms is back, which is then commanded to land.
    """
    robot = flight.robot
    land_at = {"comms": outage + 1.0, CORRUPTED: CORRUPTED_FOR}.get(failure, math.inf)
    begun = robot.stamp_ns * 1e-9
    watch = TouchDown(outcome, begun, robot.truth["position_w"][0].tolist())
    break_it(flight, failure)
    while (now := robot.stamp_ns * 1e-9 - begun) < LONGEST:
        flight.advance()
        truth = robot.truth[0]
        watch.note(
            begun + now,
            truth["position_w"].tolist(),
            float(truth["velocity_w"][2]),
            truth["quaternion_wb"].tolist(),
        )
        if failure == "comms" and not flight.heard and now > outage:
            flight.heard = True
        if now > land_at and flight.view().behavior in ("hover", "brake", "follow_trajectory"):
            flight.start("land")
        if (
            math.isnan(outcome.off)
            and robot.firmware.motor_state is not MotorState.ON
            and (robot.firmware.motor_state is not MotorState.EMERGENCY)
        ):
            outcome.off = now
        if now > outcome.off + 0.5 and not math.isnan(outcome.down):
            return


def break_it(flight: FailingFlight, failure: str) -> None:
    """Cause the failure itself."""
    if failure in ("station", "comms"):
        flight.heard = False
    elif failure == SILENT:
        flight.frozen = True
    elif failure == "tracker":
        flight.lose_tracker()
    elif failure == CORRUPTED:
        flight.disturb(corrupted_bytes=0.05)
    else:
        unplugged = {"port 0": "first", "port 1": "second", "both ports": "both"}[failure]
        flight.disturb(unplugged_port=unplugged)


def fly_all(
    seeds: int,
    failures: Sequence[str],
    starts: Sequence[str],
    settings: Settings,
    board: str = MIKROKOPTER,
    *,
    flown: Sequence[Outcome] = (),
    minutes: float = math.inf,
    keep: Callable[[Sequence[Outcome]], None] = lambda _: None,
) -> list[Outcome]:
    """Fly seeds 1 to `seeds`, on all cores.

    Args:
        settings: of the simulated world and the vehicle, besides those of a seed.
        flown: outcomes of former runs, whose flights are not repeated.
        minutes: after these no further flight begins.
        keep: is given all outcomes after each flight.
    """
    found = list(flown)
    known = {(one.failure, one.start, one.seed) for one in flown}
    deadline_s = time.monotonic() + 60.0 * minutes
    tasks = [
        task
        for flights, task in _tasks(seeds, failures, starts, settings, board)
        if not known.issuperset(flights)
    ]
    workers = multiprocessing.cpu_count() if minutes == math.inf else 1
    fork = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(workers, fork, _follow, (os.getpid(),)) as pool:
        submitted = [pool.submit(_until, deadline_s, task) for task in tasks]
        try:
            for number, one in enumerate(as_completed(submitted), start=1):
                if flights := one.result():
                    found += flights
                    keep(found)
                    landed = sum(outcome.verdict == "landed" for outcome in flights)
                    line = f"{number} of {len(tasks)}: {landed} of {len(flights)} flights landed"
                    print(line, file=sys.stderr, flush=True)
        except BaseException:  # SIGTERM, Ctrl-C: no worker ends its flight first
            for worker in multiprocessing.active_children():
                worker.terminate()
            raise
    order = [*failures, *FAILURES]  # those of former runs may not be among these
    return sorted(found, key=lambda o: (order.index(o.failure), STARTS.index(o.start), o.seed))


def _follow(parent: int) -> None:
    """End this process at SIGTERM, and with the process that started it."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    die_with_parent(parent)


def _until(deadline_s: float, fly: Callable[[], list[Outcome]]) -> list[Outcome]:
    return fly() if time.monotonic() < deadline_s else []


def _tasks(
    seeds: int, failures: Sequence[str], starts: Sequence[str], settings: Settings, board: str
) -> list[tuple[list[Flight], Callable[[], list[Outcome]]]]:
    """Return the functions to call, each with the flights whose outcomes it returns.

    Flights of their own are ordered so that those of a run that is cut short are spread over seeds
    and starts: each seed flies each failure from one start first, from the next one then.
    """
    if board == BETAFLIGHT:
        flights = [
            (failure, starts[(seed + number + turn) % len(starts)], seed)
            for turn in range(len(starts))
            for seed in range(1, seeds + 1)
            for number, failure in enumerate(failures)
        ]
        return [([one], partial(fly_alone, *one, board)) for one in flights]
    return [
        (
            [(failure, start, seed) for start in starts for failure in failures],
            partial(fly_seed, seed, failures, starts, settings, board),
        )
        for seed in range(1, seeds + 1)
    ]
