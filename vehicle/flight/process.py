"""The flight process: one real-time thread between the microcontroller and the rings.

It is run as `python -m vehicle.flight.process CONFIG` by vehicle.processes.parent; its main loop
is vehicle.flight.loop.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import msgspec

from quadrotor.errors import LinkError, QuadlabError
from quadrotor.parameters import Parameters, ParameterStore
from vehicle import mailbox
from vehicle.boards.board import Board
from vehicle.boards.kind import MIKROKOPTER, Check, Kind, find_kind
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.boards.offered import offer
from vehicle.flight.loop import FlightLoop
from vehicle.flight.pacing import MemoryPacer, Pacer, PortPacer, Robot
from vehicle.processes.config import PLUGINS, TRAJECTORIES, Rings, VehicleConfig, open_rings
from vehicle.processes.terminal import say, speak_for
from vehicle.realtime import become_real_time, freeze_garbage
from vehicle_link import clock
from vehicle_link.defects import end_at_defect
from vehicle_link.jobs import die_with_parent
from vehicle_link.lockstep import FLIGHT_PROCESS, ProcessProgress
from vehicle_link.serial.capacity import sample_period_us
from vehicle_link.serial.links import open_port
from vehicle_link.serial.port import BAUD_RATE, Port, PortError, PortProblem

if TYPE_CHECKING:
    from quadrotor.records import Record
    from vehicle.flight.stack import FlightStack

PORT_PATIENCE_S = 10.0
REPORTED_AT_ONCE = frozenset({PortProblem.BUSY, PortProblem.FORBIDDEN})
REPORTED_AFTER_S = 5.0
"""Seconds after which a missing port is reported: a simulator usually creates it soon."""
CHECK_AGAIN_S = 0.5
SHOWN = 3
"""Largest number of a board's settings that one line names; the terminal shows all of them."""
SOON_NS = 20_000_000
"""Delay, in ns, before the first sample in memory."""


class MemoryRobot(Robot, Protocol):
    """A simulated vehicle inside this process.

    Attributes:
        epoch_ns: the vehicle's time of the first sample, to be set before it.
    """

    epoch_ns: int

    @property
    def ports(self) -> Sequence[Port]:
        """Return the flight stack's ends of its lines."""


class Simulate(Protocol):
    """Function that makes a vehicle of a sample rate (Hz), whose poses `measure` receives."""

    def __call__(self, rate: int, measure: Callable[[Record], None]) -> MemoryRobot: ...


def fly(config: VehicleConfig, simulate: Simulate | None = None) -> None:
    """Compile, ask for real-time priority, then loop until a signal. Raises QuadlabError.

    Args:
        simulate: makes a vehicle in memory; None for a board at ports.
    """
    # Imported here: it imports numba and every law, which tests of the loop do not need.
    from vehicle.flight.kernels import prepare

    refusals, later = prepare(say)

    from vehicle.estimators.offer import offer_plugins
    from vehicle.flight.stack import FlightStack
    from vehicle.parameters import new_parameters

    rings = open_rings(config.rings)
    kind = find_kind(config.board)
    ports, options, unfit = _checked_ports(config, kind)
    plugins = Path(config.data, PLUGINS) if config.data else None
    for line in offer_plugins(plugins):
        say(line)
    offer(options, live=kind.live)
    parameters = new_parameters()
    if kind.live:
        options = parameters.board
    ParameterStore(parameters).preset(kind.traits.parameters | config.parameters)
    progress = ProcessProgress(config.name)
    traits = kind.traits_with(options)
    stack = FlightStack(parameters, plugins=plugins, waits=progress.in_lockstep, board=traits)
    if config.data:
        load_trajectories(stack, Path(config.data, TRAJECTORIES))
    for refusal in refusals:
        say(f"not compiled before the flight: {refusal}")
    robot = None
    if simulate is not None:
        say(f"a simulated vehicle inside this process, {config.rate} Hz")
        robot = simulate(config.rate, stack.measure)
    granted = become_real_time()
    progress.is_this_process(FLIGHT_PROCESS)
    if granted.refusal and not progress.in_lockstep:  # in lockstep nothing is late: time waits
        say(granted.refusal)
    freeze_garbage()
    _discard_old(rings, ports)
    mcu, pacer = _connect(ports, robot, config, kind, options, unfit)
    is_punctual = granted.scheduled or progress.in_lockstep
    shown = progress if progress.in_lockstep else None
    loop = FlightLoop(stack, mcu, rings, pacer, real_time=is_punctual, later=later, progress=shown)

    def stop(signal_number: int, frame: object) -> None:
        loop.stop()

    signal.signal(signal.SIGTERM, stop)
    signal.signal(signal.SIGINT, stop)
    loop.run()
    later.close()
    stack.close()


def _checked_ports(config: VehicleConfig, kind: Kind) -> tuple[list[Port], Parameters | None, str]:
    """Return the open ports, the board's options, and why the board is unfit, empty if it is
    not. Raises QuadlabError.
    """
    ports = open_ports(config.ports, bauds=kind.bauds)
    options, unfit = kind.configured(config.board_options), ""
    if ports and kind.check is not None:
        unfit = why_unfit(ports[0], options, kind.check)
        for port in ports:
            port.close()
        ports = open_ports(config.ports, bauds=kind.bauds)  # restarted: its USB device is a new one
    return ports, options, unfit


def _discard_old(rings: Rings, ports: Sequence[Port]) -> None:
    """Discard what waited while the process started.

    No delays may follow: the arrival of the first samples sets the vehicle's clock.
    """
    for ring in (rings.inbox, rings.poses, rings.bearings):
        ring.pop_all()  # the senders of earlier commands have timed out
    for port in ports:
        while port.read():  # earlier samples are out of date
            pass


def why_unfit(port: Port, options: Parameters | None, check: Check) -> str:
    """Return why the board must not be armed, "" when its settings match the options.

    Waits for a board that is silent or still landing by itself; nothing is sent to it in the
    meantime, as sticks would end its landing.
    """
    told = ""
    while True:
        try:
            lines = check(port, options, say)
            break
        except PortError:
            raise
        except LinkError as error:
            if str(error) != told and clock.has_begun():
                told = str(error)
                say(f"waiting for the board: {told}")
        time.sleep(CHECK_AGAIN_S)
    if not lines:
        return ""
    more = f"; and {len(lines) - SHOWN} more" if len(lines) > SHOWN else ""
    return (
        f"the board's settings do not fit: {'; '.join(lines[:SHOWN])}{more}. Enter what "
        "`quadlab vehicle --check` prints with the same --board and --set, then start it again"
    )


def _connect(
    ports: Sequence[Port],
    robot: MemoryRobot | None,
    config: VehicleConfig,
    kind: Kind,
    options: Parameters | None,
    unfit: str,
) -> tuple[Board, Pacer]:
    """Return the board (on serial ports or in memory) and the pacer of its samples."""
    rate = config.rate
    period_ns = 1000 * sample_period_us(rate)
    if config.board != MIKROKOPTER:
        board = kind.connect(ports, options, rate, None, unfit)
        return board, PortPacer(board, period_ns, kind.poll_ms)
    if robot is None:
        mcu = Microcontroller(ports, rate=rate, identity=config.identity)
        return mcu, PortPacer(mcu, period_ns)
    robot.epoch_ns = clock.time_ns() + SOON_NS
    start_ns = time.monotonic_ns() + SOON_NS
    mcu = Microcontroller(robot.ports, robot.epoch_ns, rate=rate)
    return mcu, MemoryPacer(robot, period_ns, start_ns)


def load_trajectories(stack: FlightStack, folder: Path) -> None:
    """Load the user's trajectory files, and packages', at start-up, never in flight."""
    from control.trajectories.library import GROUP, files_of, load_files
    from quadrotor.packaged_files import packaged_files

    files = [*(files_of(folder) if folder.is_dir() else ()), *packaged_files(GROUP).items()]
    if not files:
        return
    trajectories, refused = load_files(files)
    stack.behaviors.set_trajectories(trajectories)
    for line in refused:
        say(line)
        stack.say(f"trajectory file refused: {line}", mailbox.WARN)
    if trajectories:
        say(f"trajectories loaded: {', '.join(trajectories)}")


def open_ports(
    paths: Sequence[str],
    patience_s: float = PORT_PATIENCE_S,
    bauds: Sequence[int] = (BAUD_RATE, BAUD_RATE),
) -> list[Port]:
    """Open the ports, which may not exist yet or be held by another program.

    Raises LinkError for a link that cannot be opened, PortError for serial devices when they cannot
    be opened for `patience_s`, counted from the start of the simulation if there is one.
    """
    deadline = time.monotonic() + patience_s
    ports: list[Port] = []
    reported: set[str] = set()
    for path, baud in zip(paths, bauds, strict=False):
        while True:
            try:
                ports.append(open_port(path, baud))
                break
            except PortError as error:
                if not clock.has_begun():
                    deadline = time.monotonic() + patience_s
                if error.problem is PortProblem.NOT_SERIAL or time.monotonic() >= deadline:
                    raise
                waited_s = time.monotonic() - deadline + patience_s
                due = error.problem in REPORTED_AT_ONCE or waited_s >= REPORTED_AFTER_S
                if due and str(error) not in reported:
                    reported.add(str(error))
                    say(f"{error}; retrying for {patience_s:.0f} s")
            time.sleep(0.1)
    return ports


def main(argument: str, simulate: Simulate | None = None) -> int:
    """Run the process; return the exit status, 0 after a signal, 1 after a failure."""
    end_at_defect()
    config = msgspec.json.decode(argument, type=VehicleConfig)
    speak_for(config.name)
    die_with_parent(config.parent)
    try:
        fly(config, simulate)
    except QuadlabError as error:
        say(str(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
