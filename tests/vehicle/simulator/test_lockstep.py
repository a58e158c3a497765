"""Simulated time waits for processes that answer, and continues without those that do not."""

from __future__ import annotations

import contextlib
import os
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.vehicle.simulator.test_process import BOUND, open_ports
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator import lockstep
from vehicle.simulator.lockstep import MADE_UP_NS, PATIENCE_NS, LockstepPace
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.process import run
from vehicle_link import clock
from vehicle_link.lockstep import FLIGHT_PROCESS, STATION_PROCESS, Page, ProcessProgress, words_of
from vehicle_link.serial.commands import encode_data

MS = 1_000_000
NAME = "quad1"


def sample(milliseconds: int) -> bytes:
    """Return the frame of a sample measured at this time of the microcontroller."""
    return encode_data(struct.pack("<10h", milliseconds, *range(9)))


class Bench:
    """Pace whose computer's clock only advances by sleeping.

    Attributes:
        meanwhile: called at each sleep.
    """

    def __init__(self, page: memoryview, is_asked: bool = False) -> None:
        self.page = page
        self.wall_ns = clock.monotonic_ns()
        self.said: list[str] = []
        self.meanwhile: Callable[[], None] = lambda: None
        self.pace = LockstepPace(
            page,
            [NAME],
            10 * MS,
            self.said.append,
            lambda: self.wall_ns,
            self._sleep,
            is_asked=is_asked,
        )
        self.progress = ProcessProgress(NAME)
        self.now_ns = self.pace.begin()

    def _sleep(self, seconds: float) -> None:
        self.wall_ns += round(seconds * 1e9)
        self.meanwhile()

    def step(self, period_ns: int = MS) -> int:
        """Make a step; return the time (ns of the computer) until it was allowed."""
        began_ns = self.wall_ns
        self.now_ns += period_ns
        self.pace.reach(self.now_ns)
        self.pace.wait(self.now_ns, 0.0, lambda: False)
        return self.wall_ns - began_ns

    def deliver(self, milliseconds: int) -> None:
        """Make a sample of this time readable from the first port."""
        self.pace.lines[NAME][0].delivered(sample(milliseconds))

    def truth(self) -> None:
        """Report that the station has handled the present truth."""
        self.progress.truth(self.now_ns + self.page[clock.EPOCH])

    @property
    def offset_ns(self) -> int:
        return self.page[clock.OFFSET]


@pytest.fixture
def page(tmp_path: Path) -> Iterator[memoryview]:
    made = Page([NAME], tmp_path)
    clock.follow(made.path)
    found = clock.page()
    assert found is not None
    yield found
    clock.follow(None)
    made.close()


@pytest.fixture
def bench(page: memoryview) -> Bench:
    return Bench(page)


def test_alone_it_goes_at_the_computers_pace(bench: Bench) -> None:
    assert [bench.step() for _ in range(1000)] == [MS] * 1000
    assert clock.real_time_factor() == 1.0
    assert bench.said == []


def test_it_waits_for_the_tick_on_a_sample(bench: Bench) -> None:
    bench.deliver(7)
    bench.progress.answered(0, 7)
    assert bench.step() == MS
    bench.deliver(9)
    begun_ns = bench.wall_ns

    def late() -> None:
        if bench.wall_ns >= begun_ns + 3000 * MS:
            bench.progress.answered(0, 9)

    bench.meanwhile = late
    assert bench.step() == pytest.approx(3000 * MS, abs=3 * MS)
    assert bench.said == []
    assert sum(bench.step() for _ in range(100)) >= 100 * MS - MADE_UP_NS


def test_of_a_board_that_is_asked_it_waits_until_flight_has_looked(page: memoryview) -> None:
    bench = Bench(page, is_asked=True)
    bench.deliver(7)  # which the flight process need not handle
    bench.progress.served(bench.now_ns)
    assert [bench.step() for _ in range(2)] == [MS] * 2
    begun_ns = bench.wall_ns

    def late() -> None:
        if bench.wall_ns >= begun_ns + 3000 * MS:
            bench.progress.served(bench.now_ns)

    bench.meanwhile = late
    assert bench.step() >= 3000 * MS
    assert bench.said == []


def test_a_damaged_sample_is_not_waited_for(bench: Bench) -> None:
    bench.deliver(7)
    bench.progress.answered(0, 7)
    bench.step()
    frame = bytearray(sample(9))
    frame[10] ^= 1
    bench.pace.lines[NAME][0].delivered(bytes(frame))
    assert bench.step() == MS


def test_a_flight_process_that_is_gone_does_not_stop_time_and_may_come_back(bench: Bench) -> None:
    bench.deliver(7)
    bench.progress.answered(0, 7)
    bench.step()
    bench.deliver(9)
    assert bench.step() == pytest.approx(PATIENCE_NS, abs=4 * MS)
    assert len(bench.said) == 1
    for milliseconds in range(11, 31, 2):
        bench.deliver(milliseconds)
        assert bench.step() <= MS
    bench.progress.answered(0, 29)
    assert bench.step() <= MS
    bench.deliver(31)
    assert bench.step() > 100 * MS  # it counts again
    assert len(bench.said) == 2


def test_the_end_of_a_part_that_is_being_stopped_is_no_news(bench: Bench) -> None:
    bench.deliver(7)
    bench.progress.answered(0, 7)
    bench.step()
    bench.page[clock.STOPPING] = 1
    bench.deliver(9)
    assert bench.step() == pytest.approx(PATIENCE_NS, abs=4 * MS)
    assert bench.said == []


def test_a_flight_process_that_was_killed_is_not_waited_for_and_the_next_one_is(
    bench: Bench,
) -> None:
    words = words_of(bench.page, NAME)
    assert words is not None
    with contextlib.ExitStack() as ended:
        for last in (7, 11):
            child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
            ended.callback(child.communicate)
            words[FLIGHT_PROCESS] = child.pid
            bench.deliver(last)
            bench.progress.answered(0, last)
            assert bench.step() == MS
            child.kill()
            os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)  # dead, and not collected
            bench.deliver(last + 2)
            assert bench.step() == MS
    assert len(bench.said) == 2


def test_a_process_that_was_there_before_the_simulator_is_seen_to_end(page: memoryview) -> None:
    words = words_of(page, NAME)
    assert words is not None
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        words[STATION_PROCESS] = child.pid
        bench = Bench(page)
        bench.truth()
        assert bench.step() == MS
        child.kill()
    assert bench.step(50 * MS) == 50 * MS
    assert len(bench.said) == 1


def test_who_was_never_there_is_not_waited_for(bench: Bench) -> None:
    bench.deliver(7)
    assert bench.step() == MS
    assert bench.said == []


def test_it_waits_for_a_station_that_is_far_behind_only(bench: Bench) -> None:
    bench.truth()
    assert [bench.step() for _ in range(20)] == [MS] * 20
    bench.meanwhile = bench.truth
    assert bench.step(5 * MS) < 10 * MS
    bench.meanwhile = lambda: None
    assert bench.step(20 * MS) == 20 * MS
    assert bench.step(20 * MS) == pytest.approx(20 * MS + PATIENCE_NS, abs=4 * MS)
    assert sum(bench.step() for _ in range(100)) < 100 * MS + MS
    assert len(bench.said) == 1


def test_a_short_lateness_is_made_up_for_and_a_long_one_lost(bench: Bench) -> None:
    offset_ns = bench.offset_ns
    bench.wall_ns += MADE_UP_NS // 2
    bench.step()
    assert bench.offset_ns == offset_ns
    bench.wall_ns += 700 * MS
    bench.step()
    assert bench.offset_ns < offset_ns - 690 * MS
    assert bench.step() == MS


def test_the_real_time_factor_is_that_of_the_last_seconds(bench: Bench) -> None:
    def slow() -> None:
        bench.wall_ns += MS // 2

    bench.meanwhile = slow
    for _ in range(3000):
        bench.step()
        if bench.wall_ns - bench.offset_ns > MADE_UP_NS:  # otherwise it would catch up
            bench.wall_ns += MS
    factor = clock.real_time_factor()
    assert 0.3 < factor < 0.9
    bench.meanwhile = lambda: None
    for _ in range(4000):
        bench.step()
    assert clock.real_time_factor() == pytest.approx(1.0, abs=0.01)


def test_the_real_time_factor_falls_while_a_part_is_waited_for(bench: Bench) -> None:
    bench.deliver(7)
    bench.progress.answered(0, 7)
    for _ in range(1000):
        bench.step()
    bench.deliver(9)
    seen: list[tuple[int, float]] = []
    begun_ns = bench.wall_ns

    def late() -> None:
        seen.append((bench.wall_ns - begun_ns, clock.real_time_factor()))
        if seen[-1][0] >= 4000 * MS:
            bench.progress.answered(0, 9)

    bench.meanwhile = late
    bench.step()
    assert all(factor < 0.8 for waited_ns, factor in seen if waited_ns > 500 * MS)
    assert 0.0 < seen[-1][1] < 0.01  # 0 would mean that there is no simulation
    bench.meanwhile = lambda: None
    for _ in range(4000):
        bench.step()
    assert clock.real_time_factor() == pytest.approx(1.0, abs=0.01)


def test_the_simulator_goes_on_while_it_is_answered_and_without_who_left(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, page: memoryview
) -> None:
    monkeypatch.setattr(lockstep, "PATIENCE_NS", 1000 * MS)
    stop = threading.Event()
    thread = threading.Thread(
        target=run,
        args=(SimulatorParameters(), tmp_path, None),
        kwargs={"vehicles": (NAME,), "stop": stop},
    )
    thread.start()
    try:
        ports, progress, stamps = open_ports(tmp_path), ProcessProgress(NAME), list[int]()
        mcu = Microcontroller(ports)
        waited = threading.Event()
        for _ in range(int(BOUND / 0.001)):
            stamps += [sample.stamp_ns for sample in mcu.receive()]
            mcu.service(clock.monotonic())
            for line, milliseconds in enumerate(mcu.newest_ms):
                progress.answered(line, milliseconds)
            if len(stamps) > 300:
                break
            waited.wait(0.001)
        assert len(stamps) > 300
        assert stamps == sorted(stamps)
        left_ns = clock.monotonic_ns()
        for _ in range(int(BOUND / 0.01)):
            if clock.monotonic_ns() > left_ns + 500 * MS:
                break
            waited.wait(0.01)
        assert clock.monotonic_ns() > left_ns + 500 * MS
    finally:
        stop.set()
        thread.join(BOUND)
        for port in ports:
            port.close()
