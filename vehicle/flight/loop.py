"""The flight loop: samples of the microcontroller in, motor commands out, rings in both directions.

There is no network, no log file, no logging and no garbage collection here; output goes through
rings that never block this thread.
"""

from __future__ import annotations

import traceback
from typing import TYPE_CHECKING, Protocol

from quadrotor.parameters import ParameterStore
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.boards.board import Board, Command, ConfirmsParameters, RawSample
from vehicle.boards.board_link import BoardLink, LinkStatistics
from vehicle.boards.offered import FIRMWARE
from vehicle.flight.lateness import Lateness, LoopCounts, LoopStatistics
from vehicle.flight.microcontroller_commands import CommandedModes, CommandSender
from vehicle.flight.pacing import Pacer
from vehicle.modes import Mode
from vehicle.processes.config import Rings
from vehicle.processes.terminal import say
from vehicle_link.clock import monotonic, monotonic_ns
from vehicle_link.lockstep import ProcessProgress
from vehicle_link.serial.port import BAUD_RATE

if TYPE_CHECKING:
    from vehicle.flight.kernels import BackgroundParts

SILENCE_NS = 500_000_000
SECOND_NS = 1_000_000_000
NOTHING_YET = LoopStatistics(0.0, 0.0, 0.0, 0.0, 0.0)
NEEDS_SAMPLES = mailbox.Arm | mailbox.StartBehavior | mailbox.Bench | mailbox.CalibrateGyroscope
MESSAGES_A_TICK = 32
"""Largest number of messages read from each ring in a tick; more wait for the next tick, as a flood
of messages must not delay the motors."""


class Stack(Protocol):
    """The part of vehicle.flight.stack.FlightStack that the loop needs."""

    @property
    def record(self) -> Record: ...
    @property
    def store(self) -> ParameterStore: ...
    @property
    def outbox(self) -> list[mailbox.Notification]: ...
    @property
    def readings(self) -> list[Record]: ...
    @property
    def mode(self) -> Mode: ...
    @property
    def modes(self) -> CommandedModes: ...
    def tick(self, sample: RawSample) -> Command | None: ...
    def handle(self, command: mailbox.Command) -> mailbox.Reply: ...
    def say(self, text: str, level: int = mailbox.INFO) -> None: ...
    def measure(self, measurement: mailbox.Measurement | Record) -> None: ...
    def loop_statistics(
        self, statistics: LoopStatistics, counts: LoopCounts, rate: float, real_time: bool
    ) -> None: ...
    def link_statistics(self, statistics: LinkStatistics) -> None: ...


class FlightLoop:
    """Loop with one tick per sample: read the inbox, tick, send references, write the rings.

    Args:
        pacer: waits for the next sample.
        later: parts compiled in the background, loaded on the ground.
        progress: notified of the samples that were processed, if simulated time waits for that.

    Attributes:
        lateness: statistics of the ticks.
        counts: totals since the start.
    """

    def __init__(
        self,
        stack: Stack,
        mcu: Board,
        rings: Rings,
        pacer: Pacer,
        *,
        real_time: bool,
        later: BackgroundParts | None = None,
        progress: ProcessProgress | None = None,
    ) -> None:
        self._stopping = False
        self._later = later
        self._stack = stack
        self._mcu = mcu
        self._progress = progress
        self._rings = rings
        self._measured = rings.poses, rings.bearings
        self._real_time = real_time
        self._pacer = pacer
        self._deadlines = pacer.deadlines
        self._period_ns = pacer.deadlines.period_ns
        self.lateness = Lateness()
        self.counts = LoopCounts(self.lateness.histogram)
        self._sender = CommandSender(stack.modes, mcu)
        self._link = BoardLink(mcu)
        self._confirmed = mcu.confirmed if isinstance(mcu, ConfirmsParameters) else {}
        self._received_ns = monotonic_ns()
        self._silent = False
        self._unusable = [0, 0, 0]  # counts at the newest sample
        self._newest_ms = list(mcu.newest_ms)
        self._report_statistics(NOTHING_YET)

    def stop(self) -> None:
        """Make `run` return after the present iteration."""
        self._stopping = True

    def run(self) -> None:
        """Run until `stop`. Raises LinkError when the last port is lost."""
        while not self._stopping:
            self.once()

    def once(self) -> None:
        """Wait for bytes, or until a sample is overdue; run a tick for every complete sample."""
        self._pacer.wait()
        began_ns = now_ns = monotonic_ns()
        samples = self._mcu.receive()
        for sample in samples:
            now_ns = self._tick(sample, now_ns)
        if not samples:
            self._deadlines.check(now_ns)
        if self._later is not None and self._later.has_compiled and self._stack.mode is Mode.READY:
            self._load(self._later)
        self._watch_silence(bool(samples))
        if self._silent:
            self._drain_inbox()
        self._sender.send(None)  # a command between ticks may have changed the motor state
        self._sender.service(monotonic())
        if self._mcu.failures:
            for failure in self._mcu.failures:
                self._report(failure)
            self._mcu.failures.clear()
        if self._confirmed:
            self._stack.handle(mailbox.ChangeParameters("", "board", dict(self._confirmed)))
            self._confirmed.clear()
            self._send_outbox()
        if self._progress is not None:
            for line, milliseconds in enumerate(self._mcu.newest_ms):
                self._progress.answered(line, milliseconds)
            self._progress.served(began_ns)

    def _tick(self, sample: RawSample, began_ns: int) -> int:
        """Run the tick that began when the loop woke for its sample; return the time of its end."""
        stack = self._stack
        self._drain_inbox()
        self._sender.send(stack.tick(sample))
        self._rings.ticks.push(stack.record)
        for reading in stack.readings:
            self._rings.readings.push(reading)
        self._send_outbox()
        self._deadlines.met(sample.stamp_ns, began_ns)
        statistics = self.lateness.add(began_ns, sample.stamp_ns)
        if statistics is not None:
            self._report_statistics(statistics)
        ended_ns = monotonic_ns()
        if ended_ns - began_ns > self._period_ns:
            self.counts.overruns += 1
        return ended_ns

    def _report_statistics(self, statistics: LoopStatistics) -> None:
        counts = self.counts
        counts.missed_frames = self._deadlines.missed
        counts.damaged_frames = self._mcu.damaged
        rate = SECOND_NS / self._period_ns
        self._stack.loop_statistics(statistics, counts, rate, self._real_time)
        self._stack.link_statistics(self._link.statistics(monotonic_ns()))

    def _load(self, later: BackgroundParts) -> None:
        parts = later.load()
        self._later = None
        if parts:
            self._stack.say(f"compiled in the background and ready: {', '.join(parts)}")
            self._send_outbox()

    def _drain_inbox(self) -> None:
        inbox = self._rings.inbox
        if waiting := len(inbox):  # the inbox is usually empty
            for _ in range(min(waiting, MESSAGES_A_TICK)):
                message = inbox.pop()
                if message is not None:
                    self._handle(mailbox.decode_inbound(message))
        for ring in self._measured:
            if waiting := len(ring):
                for _ in range(min(waiting, MESSAGES_A_TICK)):
                    sample = ring.pop()
                    if sample is not None:
                        self._stack.measure(sample)

    def _handle(self, message: mailbox.Inbound) -> None:
        if isinstance(message, mailbox.Measurement):
            self._stack.measure(message)
            return
        reply = self._reply(message)
        self._send_outbox()  # first: the receiver of the reply may rely on the changes it caused
        self._rings.outbox.push(mailbox.encode(reply))

    def _reply(self, command: mailbox.Command) -> mailbox.Reply:
        if isinstance(command, mailbox.ChangeParameters) and not command.parameters:
            # An empty change requests all values, with which a comms process starts its copy.
            store = self._stack.store
            for one in store.descriptions():
                if one.name.startswith(FIRMWARE):
                    self._rings.outbox.push(mailbox.encode(mailbox.Described(one)))
            return mailbox.Reply(command.request_id, True, "", store.values(), store.revision)
        if self._silent and isinstance(command, NEEDS_SAMPLES):
            return mailbox.Reply(
                command.request_id, False, "refused: no samples from the microcontroller"
            )
        try:
            return self._stack.handle(command)
        except Exception as error:
            # A software error in one command must not stop the motors: report it and go on.
            traceback.print_exc()
            text = f"defect on board: {type(error).__name__}: {error}"
            return mailbox.Reply(command.request_id, False, text)

    def _send_outbox(self) -> None:
        messages = self._stack.outbox
        if messages:
            for message in messages:
                self._rings.outbox.push(mailbox.encode(message))
            messages.clear()

    def _watch_silence(self, received: bool) -> None:
        now_ns = monotonic_ns()
        if received or self._sets_clock():
            if self._silent:
                self._report(f"samples again after {(now_ns - self._received_ns) * 1e-9:.1f} s")
            self._received_ns, self._silent = now_ns, False
            self._unusable, self._newest_ms = self._unusable_counts(), list(self._mcu.newest_ms)
        elif not self._silent and now_ns - self._received_ns > SILENCE_NS:
            self._silent = True
            self._report(f"no sample from the microcontroller for 0.5 s; waiting. {self._why()}")

    def _sets_clock(self) -> bool:
        """Return whether samples have arrived that are not unusable: the first ones only set the
        vehicle's clock, which takes 0.8 s at 60 Hz.
        """
        is_new = self._mcu.newest_ms != self._newest_ms
        return is_new and self._unusable_counts() == self._unusable

    def _unusable_counts(self) -> list[int]:
        return [self._mcu.late, self._mcu.refused, self._mcu.damaged]

    def _why(self) -> str:
        """Return what arrived instead of samples, and what to check."""
        counts = zip(self._unusable_counts(), self._unusable, strict=True)
        late, refused, damaged = (now - before for now, before in counts)
        if late:
            return (
                f"{late} arrived with stamps before the newest one by the microcontroller's "
                "clock; they count again once the stamps are newer"
            )
        if refused:
            return (
                f"{refused} arrived with impossible values or times: if this continues, switch the "
                "microcontroller off and on"
            )
        if damaged:
            return (
                f"{damaged} pieces of bytes arrived that are not frames: is its baud rate "
                f"{BAUD_RATE}, and are these its ports?"
            )
        return "Is it switched on, and are these its ports?"

    def _report(self, line: str) -> None:
        """Report a line to the terminal and to the page."""
        say(line)
        self._stack.say(line, mailbox.WARN)
        self._send_outbox()
