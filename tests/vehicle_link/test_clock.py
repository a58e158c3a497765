"""Clock of a flight: the computer's, or that of a simulation which delays it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from quadrotor.checkout import ROOT
from quadrotor.errors import StorageError
from vehicle_link import clock
from vehicle_link.lockstep import PREFIX, SHARED_MEMORY, Page, ProcessProgress, page_at, words_of
from vehicle_link.set_clock import SetClock

SECOND = 1_000_000_000


class Wall:
    """The computer's steady clock, as set by a test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 100 * SECOND
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.now_ns)


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    made = Page(["quad1", "quad2"], tmp_path)
    clock.follow(made.path)
    yield made
    clock.follow(None)
    made.close()


@pytest.fixture
def words(page: Page) -> memoryview:
    found = clock.page()
    assert found is not None
    return found


def test_without_a_simulation_it_is_the_computers(monkeypatch: pytest.MonkeyPatch) -> None:
    Wall(monkeypatch)
    assert clock.monotonic_ns() == 100 * SECOND
    assert clock.monotonic() == 100.0
    assert abs(clock.time_ns() - time.time_ns()) < SECOND
    assert clock.real_time_factor() == 0.0
    assert not ProcessProgress("quad1").in_lockstep
    ProcessProgress("quad1").truth(5)  # no reader


def test_until_a_simulation_takes_it_over_it_goes_as_the_computers(
    monkeypatch: pytest.MonkeyPatch, page: Page
) -> None:
    wall = Wall(monkeypatch)
    before = clock.monotonic_ns(), clock.time_ns()
    wall.now_ns += 5 * SECOND
    assert (clock.monotonic_ns(), clock.time_ns()) == tuple(t + 5 * SECOND for t in before)
    assert clock.real_time_factor() == 0.0


def test_it_goes_no_further_than_the_simulation_has_got(
    monkeypatch: pytest.MonkeyPatch, words: memoryview
) -> None:
    wall = Wall(monkeypatch)
    words[clock.LIMIT] = wall.now_ns + SECOND // 10
    wall.now_ns += SECOND // 20
    assert clock.monotonic_ns() == wall.now_ns
    wall.now_ns += 3 * SECOND
    assert clock.monotonic_ns() == words[clock.LIMIT]
    assert clock.time_ns() == words[clock.LIMIT] + words[clock.EPOCH]
    assert clock.real_time_factor() == 1.0


def test_a_reader_that_is_put_off_does_not_read_of_the_past(
    monkeypatch: pytest.MonkeyPatch, words: memoryview
) -> None:
    now_ns = words[clock.LIMIT] = 100 * SECOND

    def put_off() -> int:
        words[clock.OFFSET] -= SECOND // 2  # the simulation has waited for that long
        return now_ns

    monkeypatch.setattr(time, "monotonic_ns", put_off)
    assert clock.monotonic_ns() == words[clock.LIMIT]


def test_it_runs_on_without_a_simulation_that_has_died(
    monkeypatch: pytest.MonkeyPatch, words: memoryview
) -> None:
    wall = Wall(monkeypatch)
    words[clock.LIMIT] = wall.now_ns
    told = []
    for _ in range(40):
        wall.now_ns += SECOND // 2
        told.append(clock.monotonic_ns())
    assert told == sorted(told)
    assert told[-1] == wall.now_ns - clock.DEAD_AFTER_NS
    assert clock.real_time_factor() == 0.0


def test_each_part_tells_of_its_own_vehicle(words: memoryview) -> None:
    for number, name in enumerate(("quad1", "quad2"), start=1):
        progress = ProcessProgress(name)
        assert progress.in_lockstep
        progress.answered(1, 10 * number)
        progress.served(100 * number)
        progress.truth(number + words[clock.EPOCH])
    first, second = words_of(words, "quad1"), words_of(words, "quad2")
    assert first is not None
    assert second is not None
    assert first.tolist() == [0, 10, 1, 0, 0, 0, 0, 0, 100]
    assert second.tolist() == [0, 20, 2, 0, 0, 0, 0, 0, 200]
    assert words_of(words, "quad3") is None
    assert not ProcessProgress("quad3").in_lockstep


def test_a_page_that_is_none_is_refused_with_what_to_try(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=clock.VARIABLE):
        clock.open_page(tmp_path / "nothing")
    empty = tmp_path / "empty"
    empty.touch()
    with pytest.raises(StorageError, match=clock.VARIABLE):
        clock.open_page(empty)


def test_a_page_is_found_by_its_port_while_its_owner_lives(tmp_path: Path) -> None:
    port = 60_001
    assert page_at(port) is None
    made = Page(["quad1"], tmp_path, port)
    if made.path.parent == SHARED_MEMORY:
        assert page_at(port) == made.path
    assert page_at(port + 1) is None
    made.close()
    left = SHARED_MEMORY / f"{PREFIX}{port}-left"  # of a killed one
    left.touch()
    try:
        assert page_at(port) is None
    finally:
        left.unlink(missing_ok=True)  # another laboratory that starts removes it too


def test_the_page_of_another_user_is_never_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, said = 60_002, list[str]()
    made = Page(["quad1"], SHARED_MEMORY, port)
    link = tmp_path / "link"
    link.symlink_to(made.path)
    with pytest.raises(StorageError, match=clock.VARIABLE):
        clock.open_page(link)
    with monkeypatch.context() as patch:
        patch.setattr(os, "getuid", lambda: os.geteuid() + 1)
        assert page_at(port, said.append) is None
        with pytest.raises(StorageError, match="it is another user's"):
            clock.open_page(made.path)
    assert said == [f"{made.path} is another user's; its clock is not followed"]
    made.path.chmod(0o666)
    with pytest.raises(StorageError, match="others may write it"):
        clock.open_page(made.path)
    assert page_at(port, said.append) is None
    made.path.chmod(0o600)
    assert page_at(port) == made.path
    made.close()


def test_nothing_is_left_behind(tmp_path: Path) -> None:
    made = Page(["quad1"], tmp_path)
    assert made.path.exists()
    made.close()
    assert not made.path.exists()
    made.close()


OWNER = """
import os, sys
from pathlib import Path
from vehicle_link.lockstep import Page
page = Page(["quad1"], Path(sys.argv[1]))
print(page.path, flush=True)
sys.stdin.read()
page.close()
"""


def owner(folder: Path) -> tuple[subprocess.Popen[str], Path]:
    """Return a process that owns a page, and the page's path."""
    process = subprocess.Popen(
        [sys.executable, "-c", OWNER, str(folder)],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_the_page_of_a_killed_laboratory_is_removed_at_the_next_start_and_no_living_one(
    tmp_path: Path,
) -> None:
    (killed, left), (living, kept) = owner(tmp_path), owner(tmp_path)
    try:
        killed.kill()
        killed.wait()
        made = Page(["quad1"], tmp_path)
        try:
            assert not left.exists()
            assert kept.exists()
        finally:
            made.close()
        assert not made.path.exists()
    finally:
        living.communicate()


HOUR_NS = 3_600_000_000_000
STARTED_AN_HOUR_BACK = f"""
import time
real = time.time_ns
time.time_ns = lambda: real() - {HOUR_NS}
from vehicle_link import clock
print(clock.time_ns())
"""


def test_setting_the_computers_clock_moves_no_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    before_ns, computer_ns = clock.time_ns(), time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: computer_ns() - HOUR_NS)
    assert 0 <= clock.time_ns() - before_ns < HOUR_NS // 2
    assert 0 <= clock.host_time_ns() - before_ns < HOUR_NS // 2


@pytest.mark.parametrize(("is_handed_on", "behind_ns"), [(True, 0), (False, HOUR_NS)])
def test_a_process_takes_the_epoch_of_the_one_that_starts_it(
    is_handed_on: bool, behind_ns: int
) -> None:
    """A process that starts after the computer's clock was set agrees with those before it."""
    environment = dict(os.environ)
    if not is_handed_on:
        del environment[clock.EPOCH_VARIABLE]
    program = [sys.executable, "-c", STARTED_AN_HOUR_BACK]
    told = subprocess.run(program, env=environment, stdout=subprocess.PIPE, check=True, text=True)
    assert clock.time_ns() - int(told.stdout) - behind_ns == pytest.approx(0, abs=HOUR_NS / 2)


def test_each_step_of_the_computers_clock_is_reported_once() -> None:
    set_ns = [0]
    detector = SetClock("vehicle", lambda: set_ns[0], lambda: 0)
    lines = []
    for step_ns in (0, -HOUR_NS, 0, HOUR_NS // 2, 0, 1_900_000_000, 0):
        set_ns[0] += step_ns
        lines.append(detector.report())
    assert [bool(line) for line in lines] == [False, True, False, True, False, False, False]
    assert "vehicle's computer was set back by 3600.0 s" in lines[1]
    assert "set forward by 1800.0 s" in lines[3]
    assert "until quadlab is started again" in lines[3]
