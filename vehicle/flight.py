"""The flight process: one real-time thread between the microcontroller and the rings.

No network, no log, no logging and no garbage collection here; what leaves goes through rings
that never make this thread wait. Run as `python -m vehicle.flight CONFIG` by vehicle.process.
"""

from __future__ import annotations

import select
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import msgspec

from quadrotor.errors import QuadlabError
from quadrotor.parameters import ParameterStore
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.lateness import Lateness
from vehicle.microcontroller import Microcontroller, RawSample
from vehicle.modes import Mode
from vehicle.orders import Ordered, Ordering, Orders
from vehicle.process_config import FlightConfig, Rings, open_rings
from vehicle.realtime import become_real_time, die_with_parent, freeze_garbage
from vehicle_link.serial.port import PortError, PortProblem, SerialPort

if TYPE_CHECKING:
    from vehicle.kernels import Later
    from vehicle.stack import FlightStack

POLL_MS = 50
SILENCE_NS = 500_000_000
PORT_PATIENCE_S = 10.0
TOLD_AT_ONCE = frozenset({PortProblem.BUSY, PortProblem.FORBIDDEN})
"""What a user can mend while the ports are tried again; a missing one is a simulator's, as a rule.
"""
COMMANDS_A_TICK = 32  # more wait for the next tick: a flood of messages must not delay the motors


class Stack(Ordering, Protocol):
    """What the loop needs of vehicle.stack.FlightStack."""

    record: Record
    store: ParameterStore
    outbox: list[mailbox.Event | mailbox.ParameterChange]
    mode: Mode

    def tick(self, sample: RawSample) -> tuple[int, int, int, int] | None: ...
    def handle(self, command: mailbox.Command) -> mailbox.Reply: ...
    def say(self, text: str, level: int = mailbox.INFO) -> None: ...
    def measure(self, measurement: mailbox.Measurement) -> None: ...
    def loop_statistics(
        self, *, rate: float, p50: float, p99: float, longest: float, missed: float, real_time: bool
    ) -> None: ...


class Mcu(Ordered, Protocol):
    """What the loop needs of vehicle.microcontroller.Microcontroller."""

    failures: list[str]

    def receive(self) -> list[RawSample]: ...
    def filenos(self) -> Sequence[int]: ...


class FlightLoop:
    """Sample in, tick, references out; inbox before, rings after."""

    def __init__(
        self, stack: Stack, mcu: Mcu, rings: Rings, *, real_time: bool, later: Later | None = None
    ) -> None:
        self.stopping = False
        self._later = later
        self._stack = stack
        self._mcu = mcu
        self._rings = rings
        self._real_time = real_time
        self._lateness = Lateness()
        self._orders = Orders(stack, mcu)
        self._heard_ns = time.monotonic_ns()
        self._silent = False
        self._poll = select.poll()
        for descriptor in mcu.filenos():
            self._poll.register(descriptor, select.POLLIN)
        stack.loop_statistics(
            rate=0.0, p50=0.0, p99=0.0, longest=0.0, missed=0.0, real_time=real_time
        )

    def run(self) -> None:
        """Until `stopping` is set. Raises LinkError when a port is gone."""
        while not self.stopping:
            self.once()

    def once(self, timeout_ms: int = POLL_MS) -> None:
        """Wait for bytes, at most `timeout_ms`, and tick on every sample they complete."""
        self._poll.poll(timeout_ms)
        samples = self._mcu.receive()
        for sample in samples:
            self._tick(sample)
        if self._later is not None and self._later.arrived and self._stack.mode is Mode.READY:
            self._load(self._later)
        self._watch_silence(bool(samples))
        if self._silent:
            self._drain_inbox()
        self._orders.send(None)  # a command between ticks may want another motor state
        self._orders.keep(time.monotonic())
        if self._mcu.failures:
            for line in self._mcu.failures:
                self._report(line)
            self._mcu.failures.clear()

    def _tick(self, sample: RawSample) -> None:
        began_ns = time.monotonic_ns()
        stack = self._stack
        self._drain_inbox()
        self._orders.send(stack.tick(sample))
        self._rings.ticks.push(stack.record)
        self._send_outbox()
        statistics = self._lateness.add(began_ns, sample.stamp_ns)
        if statistics is not None:
            stack.loop_statistics(
                rate=statistics.rate,
                p50=statistics.lateness_p50,
                p99=statistics.lateness_p99,
                longest=statistics.lateness_max,
                missed=statistics.missed_share,
                real_time=self._real_time,
            )

    def _load(self, later: Later) -> None:
        parts = later.load()
        self._later = None
        if parts:
            self._stack.say(f"compiled beside, and ready: {', '.join(parts)}")
            self._send_outbox()

    def _drain_inbox(self) -> None:
        inbox = self._rings.inbox
        for _ in range(min(len(inbox), COMMANDS_A_TICK)):
            message = inbox.pop()
            if message is not None:
                self._take(mailbox.decode_inbound(message))

    def _take(self, message: mailbox.Inbound) -> None:
        if isinstance(message, mailbox.Measurement):
            self._stack.measure(message)
            return
        reply = self._reply(message)
        self._send_outbox()  # first: who gets the reply may rely on the changes it caused
        self._rings.outbox.push(mailbox.encode(reply))

    def _reply(self, command: mailbox.Command) -> mailbox.Reply:
        if isinstance(command, mailbox.ChangeParameters) and not command.values:
            # An empty change asks for all values: how a comms process starts its copy.
            store = self._stack.store
            return mailbox.Reply(command.request_id, True, "", store.values(), store.revision)
        if self._silent and isinstance(command, mailbox.Arm | mailbox.StartBehavior):
            return mailbox.Reply(
                command.request_id, False, "refused: the microcontroller gives no samples"
            )
        try:
            return self._stack.handle(command)
        except Exception as error:
            # A defect in one command must not stop the motors: report it and fly on.
            traceback.print_exc()
            text = f"defect on board: {type(error).__name__}: {error}"
            return mailbox.Reply(command.request_id, False, text)

    def _send_outbox(self) -> None:
        messages = self._stack.outbox
        if messages:
            for message in messages:
                self._rings.outbox.push(mailbox.encode(message))
            messages.clear()

    def _watch_silence(self, heard: bool) -> None:
        now_ns = time.monotonic_ns()
        if heard:
            if self._silent:
                self._report(f"samples again after {(now_ns - self._heard_ns) * 1e-9:.1f} s")
            self._heard_ns, self._silent = now_ns, False
        elif not self._silent and now_ns - self._heard_ns > SILENCE_NS:
            self._silent = True
            self._report(
                "no sample from the microcontroller for 0.5 s; waiting. "
                "Is it switched on, and are these its ports?"
            )

    def _report(self, line: str) -> None:
        """To the terminal and to the page."""
        say(line)
        self._stack.say(line, mailbox.WARN)
        self._send_outbox()


def say(line: str) -> None:
    """One line to the terminal."""
    print(f"vehicle: {line}", file=sys.stderr, flush=True)


def fly(config: FlightConfig) -> None:
    """Compile, ask for real time, then loop until a signal. Raises QuadlabError."""
    # Imported here: it brings numba and every law along, which the loop's tests need not.
    from vehicle.kernels import prepare

    refusals, later = prepare(say)

    from vehicle.parameters import new_parameters
    from vehicle.stack import FlightStack

    rings = open_rings(config.rings)
    ports = open_ports(config.ports)
    parameters = new_parameters()
    ParameterStore(parameters).preset(config.parameters)
    stack = FlightStack(parameters)
    if config.trajectories:
        load_trajectories(stack, Path(config.trajectories))
    for refusal in refusals:
        say(f"not compiled before the flight: {refusal}")
    granted = become_real_time()
    if granted.refusal:
        say(granted.refusal)
    freeze_garbage()
    # From here on without delay: the first samples' arrival sets the vehicle's clock.
    rings.inbox.pop_all()  # commands from before the start have been given up by who sent them
    for port in ports:
        while port.read():  # samples from before are old
            pass
    loop = FlightLoop(
        stack, Microcontroller(ports), rings, real_time=granted.scheduled, later=later
    )

    def stop(signal_number: int, frame: object) -> None:
        loop.stopping = True

    signal.signal(signal.SIGTERM, stop)
    signal.signal(signal.SIGINT, stop)
    loop.run()
    later.close()


def load_trajectories(stack: FlightStack, folder: Path) -> None:
    """The user's trajectory files, by now or not at all: never in flight."""
    from control.trajectories.library import load_folder

    if not folder.is_dir():
        return
    stack.behaviors.trajectories, refused = load_folder(folder)
    for line in refused:
        say(line)
        stack.say(f"trajectory file refused: {line}", mailbox.WARN)
    if stack.behaviors.trajectories:
        say(f"trajectories loaded: {', '.join(stack.behaviors.trajectories)}")


def open_ports(paths: Sequence[str], patience_s: float = PORT_PATIENCE_S) -> list[SerialPort]:
    """Open the serial ports, which a simulator may still be making or another program holding.

    Raises PortError when they cannot be opened for `patience_s`.
    """
    deadline = time.monotonic() + patience_s
    ports: list[SerialPort] = []
    told: set[str] = set()
    for path in paths:
        while True:
            try:
                ports.append(SerialPort(path))
                break
            except PortError as error:
                if error.problem is PortProblem.NOT_SERIAL or time.monotonic() >= deadline:
                    raise
                if error.problem in TOLD_AT_ONCE and str(error) not in told:
                    told.add(str(error))
                    say(f"{error}; trying for {patience_s:.0f} s")
            time.sleep(0.1)
    return ports


def main(argument: str) -> int:
    """Exit status: 0 stopped by a signal, 1 failed."""
    config = msgspec.json.decode(argument, type=FlightConfig)
    die_with_parent(config.parent)
    try:
        fly(config)
    except QuadlabError as error:
        say(str(error))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
