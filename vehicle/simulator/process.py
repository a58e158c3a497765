"""The simulated vehicle on two pseudo-terminals (`quadlab simulator`).

Time: sample k is taken at start + k / rate on the monotonic clock and takes 3 ms on the line. In
real time that is the computer's clock, in lockstep (`vehicle.simulator.lockstep`) the simulation's,
which waits for the processes that must follow.
Truth is stamped with the host's epoch time at the start plus k / rate; the vehicle stamps the same
sample with its own estimate of the same constant (vehicle.boards.mikrokopter.clock), so the two
agree to within the least delay of a sample, well below 2 ms, as long as both run on one host.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quadrotor.parameters import ParameterValue
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle.simulator.attendant import Attendant
from vehicle.simulator.betaflight.firmware import BetaflightFirmware, firmware_of
from vehicle.simulator.live_parameters import LiveParameters
from vehicle.simulator.lockstep import LockstepPace
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.pseudo_terminal import PseudoTerminal
from vehicle.simulator.simulated_vehicle import PERIOD_MAX_US, SimulatedVehicle
from vehicle.simulator.truth import TruthPublisher, connect_to_station
from vehicle.simulator.uart import Uart
from vehicle_link import clock
from vehicle_link.transport.shared_session import SharedSession

if TYPE_CHECKING:
    from vehicle.simulator.tracking_systems.served import ServedSystems

PRIORITY = 40
"""SCHED_FIFO, below the flight process: late samples would look like a late flight loop."""
TOGETHER_NS = 200_000
"""Steps of several vehicles that are due within this time are made together."""
ROW, APART = 4, 1.0
"""Vehicles in a row on the floor, and m between them."""
MIN_PAUSE_S = 0.0004
"""s between two steps when behind: leaves the flight stack time to answer each sample."""
GIVE_UP_NS = 1_000_000_000
"""Delay beyond which samples are skipped, not caught up: the machine slept."""
SECOND_NS = 1_000_000_000


@dataclass(slots=True)
class RunStatistics:
    """The statistics of a run."""

    periods: int = 0  # of the microcontroller
    lost_samples: int = 0  # the machine slept
    dropped_bytes: int = 0  # no one read them
    overruns: int = 0  # bytes the wire was too slow for
    dropped_truth: int = 0  # the network was too slow


def run(
    parameters: SimulatorParameters,
    folder: Path,
    loopback_port: int | None,
    *,
    vehicles: Sequence[str] = ("quad1",),
    stop: threading.Event | None = None,
    served: ServedSystems | None = None,
    board: str = MIKROKOPTER,
    board_options: Mapping[str, ParameterValue] | None = None,
) -> RunStatistics:
    """Fly until `stop` is set, or without one until SIGTERM or SIGINT.

    Args:
        parameters: of one vehicle; of several each gets its own place and noise.
        folder: where the links `mcu0` and `mcu1` to the serial devices are made; of several
            vehicles in a folder of their name.
        loopback_port: of the station's router; None publishes no truth.
        served: tracking systems that are given the truth; closed at the end.
        board: its kind.
        board_options: values of the options of its kind.

    Raises StorageError when the links cannot be made.
    """
    if stop is None:
        stop = _stop_on_signals()
    # Before the devices exist: a device means that the microcontroller is switched on.
    SimulatedVehicle(parameters).warm_up()
    pace = pace_of(len(vehicles))
    kind = find_kind(board)
    lockstep = _lockstep(vehicles, pace, kind.is_asked)
    session = None if loopback_port is None else SharedSession(partial(_open, loopback_port))
    robots: list[_Robot] = []
    try:
        for truth, name in zip(side_by_side(parameters, len(vehicles)), vehicles, strict=True):
            place = folder if len(vehicles) == 1 else folder / name
            place.mkdir(exist_ok=True)
            firmware = firmware_of(board, kind.configured(board_options or {}))
            robots.append(_Robot(name, truth, place, session, pace, lockstep, served, firmware))
        where = f"microcontroller at {robots[0].place}"
        if len(robots) > 1:
            where = f"microcontrollers of {', '.join(vehicles)} in {folder}"
        refusal = _ask_for_priority()
        if lockstep is not None:
            refusal = ", in lockstep"
        _say(f"{where}, {parameters.imu_rate} Hz{refusal}")
        gc.collect()
        gc.freeze()
        statistics = RunStatistics()
        if lockstep is None:
            _loop(robots, statistics, stop)
        else:
            _loop_in_lockstep(robots, statistics, stop, lockstep)
        for robot in robots:
            robot.add_to(statistics)
        return statistics
    finally:
        for robot in robots:
            robot.close()
        if lockstep is not None:
            lockstep.close()
        if served is not None:
            served.close()


@dataclass(frozen=True, slots=True)
class Pace:
    """The pace of a simulation.

    Attributes:
        periods: of the microcontroller, moved at once.
        truth_rate: Hz.
    """

    periods: int
    truth_rate: int


ALONE = Pace(1, 100)
"""Pace for one, in lockstep too: woken once a sample, up to half of the ticks came a period late
with the page open."""
SOME, MANY = Pace(5, 30), Pace(9, 15)
"""Paces for several on one processor: commands then take up to 4 or 8 ms longer to the motors."""
FEW = 3
"""Largest number of vehicles that step at the pace `SOME`."""


def _lockstep(vehicles: Sequence[str], pace: Pace, is_asked: bool) -> LockstepPace | None:
    """Return the lockstep if `quadlab up` made a page of the clock, else None for real time."""
    page = clock.page()
    if page is None:
        return None
    step_ns = 1000 * PERIOD_MAX_US * pace.periods
    steps = 1 + -(-SECOND_NS // (pace.truth_rate * step_ns))
    return LockstepPace(page, vehicles, steps * step_ns, _say, is_asked=is_asked)


def pace_of(count: int) -> Pace:
    """Return the pace of each of `count` vehicles."""
    return ALONE if count == 1 else SOME if count <= FEW else MANY


class _Robot:
    """One vehicle: its plant, its serial devices and the publisher of its truth."""

    def __init__(
        self,
        name: str,
        parameters: SimulatorParameters,
        folder: Path,
        session: SharedSession | None,
        pace: Pace,
        lockstep: LockstepPace | None = None,
        served: ServedSystems | None = None,
        firmware: BetaflightFirmware | None = None,
    ) -> None:
        self._pace, self._served = pace, served
        self._name = name
        self._publisher: TruthPublisher | None = None
        self._terminals: list[PseudoTerminal] = []
        self._lines: list[Uart] = []
        self._epoch_ns = self._start_ns = self._truth_due_ns = 0
        self._firmware = firmware
        try:
            for index in (0, 1) if firmware is None else (0,):
                self._terminals.append(PseudoTerminal(folder / f"mcu{index}"))
                if firmware is None:  # another board's bytes go without the delay of a line
                    self._lines.append(Uart(self._terminals[-1]))
        except BaseException:
            self.close()
            raise
        if lockstep is not None and firmware is None:
            for line, awaited in zip(self._lines, lockstep.lines[name], strict=True):
                line.delivered = awaited.delivered
        self._simulated = SimulatedVehicle(parameters, self._lines or self._terminals, firmware)
        self._simulated.warm_up()
        self._live = LiveParameters(parameters)
        self._attendant = Attendant()
        if session is not None:
            connect = connect_to_station(session, name, self._live, self._attendant)
            self._publisher = TruthPublisher(connect, name)

    @property
    def place(self) -> str:
        return " and ".join(str(terminal.link) for terminal in self._terminals)

    @property
    def due_ns(self) -> int:
        """Return when to `step` next, in ns of the steady clock."""
        return self._start_ns + self._simulated.due_ns(self._pace.periods)

    def begin(self, epoch_ns: int, start_ns: int) -> None:
        """Begin at the present time of the epoch's clock and of the steady clock."""
        self._epoch_ns, self._start_ns = epoch_ns, start_ns

    def lose(self, behind_ns: int) -> int:
        """Skip this much time and return the number of samples lost."""
        lost = behind_ns // self._simulated.sample_period_ns
        self._simulated.skip(lost)
        return lost

    def step(self) -> None:
        simulated = self._simulated
        changed = self._live.take()
        if changed is not None:
            simulated.configure(changed)
            if self._served is not None:
                self._served.set_faults(self._name, changed.served)
        charge = self._live.take_charge()
        if charge is not None:
            simulated.charge_battery(charge)
        self._attendant.attend(simulated)
        before_ns = simulated.stamp_ns
        for line in self._lines:
            line.advance((simulated.due_ns(self._pace.periods) - before_ns) * 1e-9)
        simulated.step_periods(self._pace.periods)
        if self._publisher is not None:
            reading = simulated.bench_reading()
            if reading is not None:
                self._publisher.offer_reading(self._epoch_ns + reading.stamp_ns, reading)
        if simulated.stamp_ns >= self._truth_due_ns:
            self._truth_due_ns = simulated.stamp_ns + SECOND_NS // self._pace.truth_rate
            stamp_ns, truth = self._epoch_ns + simulated.stamp_ns, simulated.truth
            if self._publisher is not None:
                self._publisher.offer(stamp_ns, truth)
            if self._served is not None:
                pose = truth["position_w"][0], truth["quaternion_wb"][0]
                self._served.offer(self._name, stamp_ns, *pose)

    def add_to(self, statistics: RunStatistics) -> None:
        statistics.dropped_bytes += sum(terminal.dropped for terminal in self._terminals)
        statistics.overruns += sum(line.overruns for line in self._lines)
        if self._publisher is not None:
            statistics.dropped_truth += self._publisher.dropped

    def close(self) -> None:
        if self._publisher is not None:
            self._publisher.close()
        if self._firmware is not None:
            self._firmware.close()
        for terminal in self._terminals:
            terminal.close()


def _loop(robots: Sequence[_Robot], statistics: RunStatistics, stop: threading.Event) -> None:
    for robot in robots:
        robot.begin(time.time_ns(), time.monotonic_ns())
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
    robots: Sequence[_Robot],
    statistics: RunStatistics,
    stop: threading.Event,
    lockstep: LockstepPace,
) -> None:
    start_ns = lockstep.begin()
    for robot in robots:
        robot.begin(clock.time_ns(), start_ns)
    while not stop.is_set():
        due_ns = min(robot.due_ns for robot in robots)
        lockstep.wait(due_ns, MIN_PAUSE_S, stop.is_set)
        _step(robots, due_ns, statistics)
        lockstep.reach(min(robot.due_ns for robot in robots))


def _step(robots: Sequence[_Robot], due_ns: int, statistics: RunStatistics) -> None:
    """Step all vehicles that are due, in one wake-up."""
    for robot in robots:
        if robot.due_ns <= due_ns + TOGETHER_NS:
            robot.step()
            statistics.periods += 1


def side_by_side(parameters: SimulatorParameters, count: int) -> list[SimulatorParameters]:
    """Return the parameters of `count` vehicles in rows of four on the floor, 1 m apart, each with
    noise of its own.
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


def _open(loopback_port: int) -> Any:
    # Imported here: Zenoh takes a while, the plant need not wait.
    from vehicle_link.transport.session import loopback_session

    return loopback_session(loopback_port)


def _ask_for_priority() -> str:
    """Ask for SCHED_FIFO for this thread; return what to add to the first line when refused."""
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
