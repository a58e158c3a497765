"""`quadlab vehicle`: create the rings, run flight and comms as two processes, and monitor them.

A comms process that dies is restarted and finds the rings unchanged; when flight dies the vehicle
ends, because the microcontroller's emergency mode has taken over.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import FrameType

import msgspec

from quadrotor.checkout import PREFIX, ROOT
from quadrotor.errors import StorageError
from quadrotor.parameter_description import ParameterValue
from vehicle import mailbox
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle.calibration.store import FOLDER, CalibrationStore
from vehicle.processes.config import DEAF, GIVEN_UP, PACKETS_A_SECOND, VehicleConfig, create_rings
from vehicle.processes.terminal import say, speak_for
from vehicle_link import clock
from vehicle_link.addresses import EVERYWHERE
from vehicle_link.defects import outlast_readers
from vehicle_link.forked import Process, share, start
from vehicle_link.identity import THE_ONE, Identity
from vehicle_link.jobs import how_it_ended
from vehicle_link.process_instance import new_instance
from vehicle_link.serial.capacity import DEFAULT_RATE

PATIENCE_S = 5.0
SHORT_PAUSE_S, LONG_PAUSE_S = 0.1, 5.0
"""Pauses before a restart of the comms process: a vehicle in flight outlasts the short one, and
lands in the long one, which is longer than `safety.link_timeout` and `link_land_after` together."""
DEATHS_OUTLASTED, DEATHS_WITHIN_S = 3, 30.0
"""Deaths of the comms process within this time that are followed by the short pause."""
FLIGHT, IN_MEMORY, COMMS = (
    f"{PREFIX}vehicle.{name}" for name in ("flight.process", "in_memory", "comms.process")
)
"""Modules of the flight process, of that without ports, and of the comms process."""
IMPORTED = [FLIGHT, f"{PREFIX}vehicle.flight.stack", COMMS]
"""Modules that both processes, or one of them, would import at each start."""


class _Children:
    """The two processes; only the main thread starts them, or PR_SET_PDEATHSIG would misfire."""

    def __init__(self, config: VehicleConfig) -> None:
        self._config = config
        self.comms_restarted = False
        self.flight = self._start(FLIGHT if config.ports else IN_MEMORY)
        self.comms = self._start(COMMS)

    def notice(self, line: str) -> None:
        """Let the next comms process, and no other, tell the station this line."""
        self._config = msgspec.structs.replace(self._config, notices=[(mailbox.WARN, line)])

    def restart_comms(self) -> None:
        self.comms_restarted = True
        self.comms = self._start(COMMS)

    def stop(self) -> None:
        """Stop the children by SIGTERM, then by SIGKILL after a delay; none is left."""
        both = (self.flight, self.comms)
        for process in both:
            if process.poll() is None:
                process.terminate()
        for process in both:
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                say(f"process {process.pid} does not end; killed")
                process.kill()
                process.wait()

    def _start(self, module: str) -> Process:
        # A separate group: Ctrl-C in the terminal reaches only the parent, which then ends both.
        return start(
            module,
            [msgspec.json.encode(self._config).decode()],
            keep=self._config.rings.all,
            folder=ROOT,
        )


class CommsDeaths:
    """The recent deaths of the comms process, which decide on the pause before its restart.

    A vehicle flies on through a few. A process that dies again and again would hold it in the air
    without reliable poses and commands, even if each of its lives is long enough for a heartbeat.
    """

    def __init__(self) -> None:
        self._deaths: list[float] = []

    def pause(self, now: float) -> float:
        """Count a death at this time (s, monotonic); return the pause that follows, in s."""
        self._deaths = [t for t in self._deaths if now - t < DEATHS_WITHIN_S] + [now]
        return SHORT_PAUSE_S if len(self._deaths) <= DEATHS_OUTLASTED else LONG_PAUSE_S


class _Signals:
    """SIGTERM, SIGINT and SIGCHLD, without polling."""

    WATCHED = (signal.SIGTERM, signal.SIGINT, signal.SIGCHLD)

    def __init__(self) -> None:
        self.stopping = False
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        self._before = {number: signal.signal(number, self._note) for number in self.WATCHED}
        self._wakeup_before = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)

    def wait(self, timeout_s: float | None) -> None:
        """Wait until the next signal or the timeout."""
        ready, _, _ = select.select([self._reader], [], [], timeout_s)
        if ready:
            os.read(self._reader, 64)

    def restore(self) -> None:
        signal.set_wakeup_fd(self._wakeup_before)
        for number, handler in self._before.items():
            signal.signal(number, handler)
        os.close(self._reader)
        os.close(self._writer)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if number != signal.SIGCHLD:
            self.stopping = True


def run_vehicle(
    ports: list[str],
    data: Path,
    link_port: int,
    name: str = "quad1",
    settings: Mapping[str, ParameterValue] | None = None,
    rate: int = DEFAULT_RATE,
    identity: Identity = THE_ONE,
    packets: int = PACKETS_A_SECOND,
    board: str = MIKROKOPTER,
    board_options: Mapping[str, ParameterValue] | None = None,
    link_host: str = EVERYWHERE,
) -> int:
    """Run until SIGTERM or SIGINT (returns 0), or until the flight process ends by itself (1).

    Call it from the main thread.

    Args:
        ports: the microcontroller's serial ports, one or two; none for a simulated vehicle inside
            the flight process.
        data: folder for certificates and onboard logs.
        link_port: UDP port to which the station connects.
        settings: initial parameter values, which override those of stored calibrations.
        rate: ticks a second, which the ports must sustain.
        identity: identity of the microcontroller; motors start with no other.
        packets: telemetry packets a second, FEWEST_PACKETS to PACKETS_A_SECOND.
        board: name of the kind of board.
        board_options: values of the options of that kind.
        link_host: address at which the station connects, of this computer.
    """
    outlast_readers()
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # it flies on without its terminal
    speak_for(name)
    rings = create_rings()
    started_ns = clock.time_ns()
    folder = data.resolve()
    values, refused, notices = _with_calibrations(folder, dict(settings or {}), board)
    config = VehicleConfig(
        parent=os.getpid(),
        rings=rings,
        name=name,
        data=str(folder),
        parameters=values,
        identity=identity,
        ports=ports,
        rate=rate,
        board=board,
        board_options=dict(board_options or {}),
        link_host=link_host,
        link_port=link_port,
        started_ns=started_ns,
        refused_calibrations=refused,
        notices=notices,
        packets=packets,
        line_ns=find_kind(board).traits.line_ns if ports else 0,
        instance=new_instance(),
    )
    return _run(config, data)


def _run(config: VehicleConfig, data: Path) -> int:
    """Run both processes until the end; return the exit status."""
    signals = _Signals()
    try:
        torn = _torn_logs(data)
        share(IMPORTED)
        children = _Children(config)
        _repair(torn)
        try:
            return _watch(children, signals, data)
        finally:
            children.stop()
    finally:
        signals.restore()
        for descriptor in config.rings.all:
            os.close(descriptor)


def _with_calibrations(
    data: Path, settings: dict[str, ParameterValue], board: str
) -> tuple[dict[str, ParameterValue], list[int], list[tuple[int, str]]]:
    """Return (values to start with, stamps of rejected records, events) of stored calibrations.

    Problems are also printed here, as no station may be connected to read them.
    """
    if not (data / FOLDER).exists():
        return settings, [], []
    # Imported here, as it imports the whole parameter tree, which a vehicle without calibrations
    # does not need.
    from vehicle.calibration.in_force import start_values

    unusable: list[str] = []
    newest = CalibrationStore(data, unusable.append).newest()
    found = start_values(newest, settings, find_kind(board).traits.parameters)
    notices = [(mailbox.WARN, line) for line in unusable]
    notices += [(mailbox.WARN if is_bad else mailbox.INFO, line) for is_bad, line in found.lines]
    for _, line in notices:
        say(line)
    return found.values, found.refused, notices


def _watch(children: _Children, signals: _Signals, data: Path) -> int:
    restart_at: float | None = None
    deaths, said = CommsDeaths(), set[str]()
    while not signals.stopping:
        if children.flight.poll() is not None:
            say(f"flight process {how_it_ended(children.flight.returncode)}; vehicle ends")
            return 1
        if restart_at is None and children.comms.poll() is not None:
            status, now = children.comms.returncode, time.monotonic()
            if status == GIVEN_UP and not children.comms_restarted:
                return 1
            how = "heard no commands" if status == DEAF else how_it_ended(status)
            say(f"comms process {how}; starting it again")
            children.notice(f"the comms process {how} and was started again")
            restart_at = now + deaths.pause(now)
        if restart_at is not None and time.monotonic() >= restart_at:
            restart_at = _restart_comms(children, data, said)
        signals.wait(None if restart_at is None else max(0.0, restart_at - time.monotonic()))
    return 0


def _restart_comms(children: _Children, data: Path, said: set[str]) -> float | None:
    """Restart the comms process; return when to try again if the system starts no process.

    Args:
        said: the lines about tries that failed, each of which is shown once.
    """
    try:
        torn = _torn_logs(data)
        children.restart_comms()
    except OSError as error:  # no file descriptor or no memory is left
        line = f"the comms process cannot be restarted yet: {error.strerror}; trying on"
        if line not in said:
            said.add(line)
            say(line)
        return time.monotonic() + SHORT_PAUSE_S
    said.clear()
    _repair(torn)
    return None


def _torn_logs(data: Path) -> list[Path]:
    """Return the torn onboard logs; to be listed before comms opens a new one."""
    try:
        if not any((data / "onboard").glob("*.mcap")):
            return []
    except OSError:  # no file descriptor is left; the logs are repaired after the next restart
        return []
    from vehicle.onboard_log.repair import torn_logs  # mcap, rosbags: needed only here

    try:
        return torn_logs(data)
    except StorageError as error:
        say(str(error))
        return []


def _repair(torn: list[Path]) -> None:
    """Repair these logs in this process, where nothing else needs the processor.

    In a thread, so after the start of children: none is a copy of a process with two threads.
    """
    if torn:
        threading.Thread(target=_recover, args=(torn,), daemon=True).start()


def _recover(torn: list[Path]) -> None:
    from vehicle.onboard_log.repair import recover_logs

    for line in recover_logs(torn):
        say(line)
