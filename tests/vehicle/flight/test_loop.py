"""Flight loop with a fake stack and a fake microcontroller: order, rings, silence."""

from __future__ import annotations

import copy
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadrotor.errors import LinkError
from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, ParameterStore, parameter
from quadrotor.records import JUDGED_READING, Record, bearings_sample, new_tick, pose_sample
from vehicle import mailbox
from vehicle.boards.board import Command, RawSample
from vehicle.boards.board_link import LinkStatistics
from vehicle.flight.lateness import LoopCounts, LoopStatistics
from vehicle.flight.loop import MESSAGES_A_TICK, FlightLoop
from vehicle.flight.pacing import Deadlines, PortPacer
from vehicle.flight.process import open_ports
from vehicle.modes import Mode
from vehicle.processes.config import Rings, create_rings, open_rings
from vehicle_link import clock
from vehicle_link.link_counts import LinkCounts
from vehicle_link.lockstep import one_clock
from vehicle_link.serial.serial_port import SerialPort

PERIOD_NS = 2_000_000


class Component(Parameters):
    gain: float = parameter(2.5, description="a gain", ge=0.0, le=10.0)


class Root(Parameters):
    part: Component = Component()


class FakeStack:
    """Fake stack, which records the loop's calls."""

    def __init__(self) -> None:
        self.record: Record = new_tick()
        self.store = ParameterStore(Root().model_copy(deep=True))
        self.outbox: list[mailbox.Notification] = []
        self.readings = [np.zeros(1, JUDGED_READING)]
        self.motor_state_wanted = MotorState.OFF
        self.command_timeout = 0.25
        self.located: Record | None = None
        self.lost_ports = 0
        self.obstacle = ""
        self.modes = self
        self.mode = Mode.READY
        self.calls: list[object] = []
        self.statistics: list[tuple[LoopStatistics, LoopCounts, float, bool]] = []
        self.references: tuple[int, int, int, int] | None = (1, 2, 3, 4)

    def microcontroller_reports(self, lost_ports: int, obstacle: str) -> None:
        self.lost_ports, self.obstacle = lost_ports, obstacle

    def tick(self, sample: RawSample) -> tuple[int, int, int, int] | None:
        self.calls.append(sample.stamp_ns)
        self.readings[0]["stamp_ns"] = sample.stamp_ns
        self.record["sequence"] += 1
        self.record["imu"]["stamp_ns"] = sample.stamp_ns
        return self.references

    def handle(self, command: mailbox.Command) -> mailbox.Reply:
        self.calls.append(command)
        if isinstance(command, mailbox.Arm):
            self.motor_state_wanted = MotorState.ON
            self.say(f"armed by {command.requester}")
        if isinstance(command, mailbox.Disarm):
            raise ZeroDivisionError("a defect")
        return mailbox.Reply(command.request_id, True)

    def say(self, text: str, level: int = mailbox.INFO) -> None:
        self.outbox.append(mailbox.Event(0, level, text))

    def measure(self, measurement: mailbox.Measurement | Record) -> None:
        kept = measurement.tobytes() if isinstance(measurement, np.ndarray) else measurement
        self.calls.append(kept)

    def loop_statistics(
        self, statistics: LoopStatistics, counts: LoopCounts, rate: float, real_time: bool
    ) -> None:
        self.statistics.append((statistics, copy.deepcopy(counts), rate, real_time))

    def link_statistics(self, statistics: LinkStatistics) -> None:
        self.link = statistics


class FakeMcu:
    """Fake microcontroller, which returns the given samples."""

    def __init__(self) -> None:
        self.failures: list[str] = []
        self.confirmed: dict[str, ParameterValue] = {}
        self.newest_ms = [-1, -1]
        self.link = LinkCounts()
        self.given: list[RawSample] = []
        self.commands: list[Command] = []
        self.motor_states: list[MotorState] = []
        self.timeouts: list[int] = []
        self.lost_ports = 0
        self.obstacle = ""
        self.damaged = self.refused = self.late = 0
        self.serviced = 0
        self._reader, self._writer = os.pipe()

    def receive(self) -> list[RawSample]:
        given, self.given = self.given, []
        return given

    def command(self, command: Command) -> None:
        self.link.commands += 1
        self.commands.append(command)

    def set_motor_state(self, state: MotorState) -> None:
        self.motor_states.append(state)

    def set_command_timeout(self, milliseconds: int) -> None:
        self.timeouts.append(milliseconds)

    def service(self, now_s: float) -> None:
        self.serviced += 1

    def filenos(self) -> Sequence[int]:
        return (self._reader,)

    def close(self) -> None:
        os.close(self._reader)
        os.close(self._writer)


class NoWaiting:
    """Pacer for samples that are available at once."""

    def __init__(self) -> None:
        self.deadlines = Deadlines(PERIOD_NS)

    def wait(self) -> None: ...


class Bench:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 1_000_000_000
        self._samples = 0
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.now_ns)
        self.stack, self.mcu = FakeStack(), FakeMcu()
        self.rings: Rings = open_rings(create_rings())
        self.loop = FlightLoop(self.stack, self.mcu, self.rings, NoWaiting(), real_time=False)

    def send(self, *messages: mailbox.Inbound) -> None:
        for message in messages:
            assert self.rings.inbox.push(mailbox.encode(message))

    def samples(self, count: int) -> list[int]:
        """Run the loop once on `count` samples; return their stamps."""
        for _ in range(count):
            self._samples += 1
            stamp = self._samples * PERIOD_NS
            self.mcu.given.append(
                RawSample(stamp, (512,) * 3, (512,) * 3, 16.0, 1e5, MotorState.OFF)
            )
        stamps = [sample.stamp_ns for sample in self.mcu.given]
        self.now_ns += count * PERIOD_NS
        self.loop.once()
        return stamps

    def nothing(self, nanoseconds: int) -> None:
        self.now_ns += nanoseconds
        self.loop.once()

    def outbox(self) -> list[mailbox.Outbound]:
        return [mailbox.decode_outbound(message) for message in self.rings.outbox.pop_all()]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    made = Bench(monkeypatch)
    yield made
    made.mcu.close()


POSE = pose_sample(7, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0))
BEARINGS = bearings_sample(8, (3, 1), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), 0.02)


class Compiled:
    """Part compiled in the background, loaded when it is ready."""

    has_compiled = False
    loads = 0

    def load(self) -> list[str]:
        self.loads += 1
        return ["error-state filter"]


def test_what_was_compiled_beside_is_loaded_on_the_ground_and_only_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = Bench(monkeypatch)
    later = Compiled()
    loop = FlightLoop(
        made.stack,
        made.mcu,
        made.rings,
        NoWaiting(),
        real_time=False,
        later=later,  # type: ignore[arg-type]
    )
    made.stack.mode = Mode.READY
    loop.once()
    assert later.loads == 0
    later.has_compiled = True
    for mode in (Mode.STARTING, Mode.ARMED, Mode.EMERGENCY_LAND):
        made.stack.mode = mode
        loop.once()
    assert later.loads == 0
    made.stack.mode = Mode.READY
    for _ in range(3):
        loop.once()
    assert later.loads == 1
    made.mcu.close()


def test_every_sample_makes_one_tick_one_command_and_one_record(bench: Bench) -> None:
    stamps = bench.samples(3)
    assert bench.stack.calls == stamps
    assert bench.mcu.commands == [(1, 2, 3, 4)] * 3
    assert bench.rings.ticks.pop_all()["imu"]["stamp_ns"].tolist() == stamps
    assert bench.rings.readings.pop_all()["stamp_ns"].tolist() == stamps


def test_a_sample_counts_as_dealt_with_when_its_command_is_written() -> None:
    told: list[tuple[int, int, int]] = []
    stack, mcu = FakeStack(), FakeMcu()

    class Part:
        def answered(self, line: int, milliseconds: int) -> None:
            told.append((line, milliseconds, len(mcu.commands)))

        def served(self, began_ns: int) -> None:
            served.append((began_ns, len(mcu.commands)))

    served: list[tuple[int, int]] = []
    rings = open_rings(create_rings())
    progress: Any = Part()
    loop = FlightLoop(stack, mcu, rings, NoWaiting(), real_time=True, progress=progress)
    loop.once()
    began_ns = clock.monotonic_ns()
    taken = RawSample(2_000_000, (512,) * 3, (512,) * 3, 16.0, 1e5, MotorState.OFF)
    mcu.given, mcu.newest_ms = [taken], [2, -1]
    loop.once()
    assert told == [(0, -1, 0), (1, -1, 0), (0, 2, 1), (1, -1, 1)]
    assert [commands for _, commands in served] == [0, 1]
    assert served[0][0] <= began_ns <= served[1][0]
    mcu.close()


def test_nothing_is_sent_to_the_motors_when_the_stack_gives_none(bench: Bench) -> None:
    bench.stack.references = None
    bench.samples(2)
    assert bench.mcu.commands == []
    assert len(bench.rings.ticks.pop_all()) == 2


def test_the_inbox_is_drained_in_order_before_the_tick(bench: Bench) -> None:
    arm = mailbox.Arm("r1", "anna")
    joy = mailbox.Joy(6, (0.0, 0.0, 0.0, 0.0), True)
    bench.rings.bearings.push(BEARINGS)
    bench.rings.poses.push(POSE)
    bench.send(joy, arm, mailbox.Heartbeat(9))
    (stamp,) = bench.samples(1)
    messages = [joy, arm, mailbox.Heartbeat(9)]
    assert bench.stack.calls == [*messages, POSE.tobytes(), BEARINGS.tobytes(), stamp]


def test_changes_leave_before_the_reply_that_reports_them(bench: Bench) -> None:
    bench.send(mailbox.Arm("r1", "anna"))
    bench.samples(1)
    assert bench.outbox() == [
        mailbox.Event(0, mailbox.INFO, "armed by anna"),
        mailbox.Reply("r1", True),
    ]


def test_the_motor_state_is_passed_on_once_when_it_changes(bench: Bench) -> None:
    bench.samples(2)
    bench.send(mailbox.Arm("r1", "anna"))
    bench.samples(1)
    bench.samples(1)
    assert bench.mcu.motor_states == [MotorState.ON]
    assert bench.mcu.serviced == 3


def test_a_flood_of_messages_does_not_delay_the_motors(bench: Bench) -> None:
    beat = mailbox.Heartbeat(9)
    bench.send(*[beat] * (MESSAGES_A_TICK + 5))
    for _ in range(MESSAGES_A_TICK + 4):
        bench.rings.poses.push(POSE)
    first, second = bench.samples(2)
    pose, most = POSE.tobytes(), MESSAGES_A_TICK
    before = [beat] * most + [pose] * most
    assert bench.stack.calls == [*before, first, *[beat] * 5, *[pose] * 4, second]


def test_an_empty_change_asks_for_all_parameters(bench: Bench) -> None:
    bench.stack.store.set({"part.gain": 4.0})
    bench.send(mailbox.ChangeParameters("r1", "comms", {}))
    bench.samples(1)
    assert bench.outbox() == [mailbox.Reply("r1", True, "", {"part.gain": 4.0}, 1)]


def test_a_defect_in_a_command_is_reported_and_flying_goes_on(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.send(mailbox.Disarm("r1", "anna"))
    (stamp,) = bench.samples(1)
    (reply,) = bench.outbox()
    assert reply == mailbox.Reply("r1", False, "defect on board: ZeroDivisionError: a defect")
    assert "ZeroDivisionError" in capsys.readouterr().err
    assert bench.stack.calls[-1] == stamp


def test_a_second_of_samples_gives_statistics(bench: Bench) -> None:
    _, _, rate, real_time = bench.stack.statistics[0]
    assert (rate, real_time) == (500.0, False)
    bench.mcu.damaged = 3
    for _ in range(501):
        bench.samples(1)
    ((statistics, counts, _, _),) = bench.stack.statistics[1:]
    assert statistics == LoopStatistics(500.0, 0.0, 0.0, 0.0, 0.0)
    assert counts.lateness.tolist() == [500] + [0] * 7
    assert (counts.overruns, counts.missed_frames, counts.damaged_frames) == (0, 0, 3)


def test_ticks_longer_than_a_period_and_periods_without_a_sample_are_counted(bench: Bench) -> None:
    bench.samples(1)
    tick = bench.stack.tick

    def slow(sample: RawSample) -> tuple[int, int, int, int] | None:
        bench.now_ns += PERIOD_NS + 1
        return tick(sample)

    bench.stack.tick = slow  # type: ignore[method-assign]
    bench.samples(1)
    bench.stack.tick = tick  # type: ignore[method-assign]
    bench.now_ns -= PERIOD_NS + 1
    bench.samples(1)
    assert bench.loop.counts.overruns == 1
    bench.nothing(3 * PERIOD_NS)
    bench.now_ns -= 3 * PERIOD_NS
    bench._samples += 2  # lost on the line
    bench.now_ns += 2 * PERIOD_NS
    for _ in range(500):
        bench.samples(1)
    assert bench.stack.statistics[-1][1].missed_frames == 2


def test_silence_is_said_once_and_so_is_its_end(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.samples(1)
    bench.nothing(400_000_000)
    assert capsys.readouterr().err == ""
    bench.nothing(200_000_000)
    bench.nothing(600_000_000)
    (line,) = capsys.readouterr().err.splitlines()
    assert "no sample from the microcontroller for 0.5 s" in line
    bench.samples(1)
    (line,) = capsys.readouterr().err.splitlines()
    assert "samples again after 1.2 s" in line
    assert [type(message) for message in bench.outbox()] == [mailbox.Event] * 2


def test_the_first_samples_which_only_set_the_clock_are_no_silence(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    for ms in range(0, 900, 18):  # 50 samples at 60 Hz
        bench.mcu.newest_ms[0] = ms
        bench.nothing(18_000_000)
    assert capsys.readouterr().err == ""
    bench.nothing(600_000_000)
    assert "no sample from the microcontroller for 0.5 s" in capsys.readouterr().err


def test_bytes_that_are_no_frames_are_told_apart_from_silence(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.samples(1)
    bench.mcu.damaged = 12
    bench.nothing(600_000_000)
    (line,) = capsys.readouterr().err.splitlines()
    assert "for 0.5 s; waiting. 12 pieces of bytes arrived that are not frames: is its baud" in line


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("late", "12 arrived with stamps before the newest one"),
        ("refused", "12 arrived with impossible values or times"),
    ],
)
def test_samples_that_do_not_count_are_told_apart_from_silence(
    bench: Bench, capsys: pytest.CaptureFixture[str], what: str, said: str
) -> None:
    setattr(bench.mcu, what, 5)  # before: not reported
    bench.samples(1)
    setattr(bench.mcu, what, 17)
    bench.nothing(600_000_000)
    (line,) = capsys.readouterr().err.splitlines()
    assert f"for 0.5 s; waiting. {said}" in line
    assert "switched on" not in line


def test_without_samples_an_emergency_acts_and_what_turns_motors_is_refused(bench: Bench) -> None:
    bench.nothing(600_000_000)
    bench.outbox()
    cut = mailbox.Emergency("r1", "anna", "cut")
    bench.send(
        cut,
        mailbox.Arm("r2", "anna"),
        mailbox.Bench("r3", "anna", 1, 100, True),
        mailbox.CalibrateGyroscope("r4", "anna"),
    )
    bench.nothing(1)
    assert bench.stack.calls == [cut]
    refused = "refused: no samples from the microcontroller"
    assert bench.outbox() == [
        mailbox.Reply("r1", True),
        *(mailbox.Reply(request_id, False, refused) for request_id in ("r2", "r3", "r4")),
    ]


def test_what_the_microcontroller_refused_is_said(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    bench.mcu.failures.append("microcontroller: wrong robot")
    bench.samples(1)
    assert "wrong robot" in capsys.readouterr().err
    assert bench.outbox() == [mailbox.Event(0, mailbox.WARN, "microcontroller: wrong robot")]
    assert bench.mcu.failures == []


def test_a_full_ring_costs_records_not_ticks(bench: Bench) -> None:
    slots = bench.rings.ticks.slots
    for _ in range(slots + 3):
        bench.samples(1)
    assert len(bench.stack.calls) == slots + 3
    assert bench.rings.ticks.dropped == 3


def test_a_port_that_never_comes_is_one_clear_line() -> None:
    with pytest.raises(LinkError, match="serial port /nowhere/mcu0 cannot be opened"):
        open_ports(["/nowhere/mcu0"], patience_s=0.0)


def test_what_is_no_serial_device_is_not_waited_for(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(LinkError, match="not a serial device"):
        open_ports([str(tmp_path / "file")], patience_s=1e9)


def test_a_port_that_is_missing_for_longer_than_a_simulator_starts_is_told_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("vehicle.flight.process.REPORTED_AFTER_S", 0.1)
    with pytest.raises(LinkError, match="plug it in"):
        open_ports(["/nowhere/mcu0"], patience_s=2.0)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("vehicle: serial port /nowhere/mcu0 cannot be opened: No such file")
    assert line.endswith("; retrying for 2 s")


def test_a_simulator_that_compiles_is_waited_for_in_silence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now, patience_s = 0.0, 10.0

    def pause(seconds: float) -> None:
        nonlocal now
        now += 1.0
        words = clock.page()
        if words is not None and now >= 10 * patience_s:
            words[clock.LIMIT] = 0  # it has begun

    monkeypatch.setattr(time, "sleep", pause)
    monkeypatch.setattr(time, "monotonic", lambda: now)
    with one_clock(["quad1"], tmp_path, 0), pytest.raises(LinkError, match="plug it in"):
        open_ports(["/nowhere/mcu0"], patience_s)
    assert 10 * patience_s < now <= 11 * patience_s
    (line,) = capsys.readouterr().err.splitlines()
    assert "retrying" in line


def test_a_port_in_use_is_told_once_and_opened_when_it_is_free(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    master, slave = os.openpty()
    path = os.ttyname(slave)
    other = SerialPort(path)
    tries = 0

    def pause(seconds: float) -> None:
        nonlocal tries
        tries += 1
        if tries == 3:
            other.close()

    monkeypatch.setattr(time, "sleep", pause)
    (port,) = open_ports([path], patience_s=60.0)
    assert tries == 3
    assert capsys.readouterr().err == (
        f"vehicle: serial port {path} cannot be opened: busy: another program has it open; "
        "end that one, another `quadlab vehicle` for one; retrying for 60 s\n"
    )
    port.close()
    os.close(master)
    os.close(slave)


def test_the_command_timeout_is_set_once_and_when_it_changes(bench: Bench) -> None:
    for _ in range(3):
        bench.samples(1)
    assert bench.mcu.timeouts == [250]
    bench.stack.command_timeout = 0.4
    bench.mcu.lost_ports = 1
    bench.samples(1)
    assert bench.mcu.timeouts == [250, 400]
    assert bench.stack.lost_ports == 1


def test_a_port_that_is_gone_does_not_wake_the_loop_any_more(bench: Bench) -> None:
    reader, writer = os.pipe()
    pacer = PortPacer(bench.mcu, PERIOD_NS)
    gone = bench.mcu.filenos()
    bench.mcu.filenos = lambda: (reader,)  # type: ignore[method-assign]
    os.close(bench.mcu._writer)  # disconnected
    assert pacer._poll.poll(0)
    bench.mcu.lost_ports = 1
    pacer.wait()
    assert pacer._poll.poll(0) == []
    bench.mcu._reader, bench.mcu._writer = reader, writer
    os.close(*gone)
