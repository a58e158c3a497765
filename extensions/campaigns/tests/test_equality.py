"""Runs that are killed, starved or robbed of their folder: their rows are those of a calm run."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from extensions.campaigns.engines.stop import StoppedBySignal, kept_when_stopped
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.tests.conftest import rows
from extensions.campaigns.tests.disturbed import kill_workers, rows_of, started, until, workers_of

CASES = 'experiment = "cases.py"\nseeds = 8\n[fixed]\n"experiment.height" = 1.5\n'
LOGGED = CASES + '[keep]\nlogs = "all"\n'


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> CampaignFolder:
    """Return the undisturbed campaign, with the log of each flight."""
    from extensions.campaigns.tests.conftest import Bench

    return Bench(tmp_path_factory.mktemp("calm"), None).flown(LOGGED, "out")  # type: ignore[arg-type]


def files(folder: CampaignFolder) -> list[bytes]:
    return [one.read_bytes() for one in sorted((folder.path / "logs").iterdir())]


def test_rows_are_those_of_a_calm_run_whatever_was_killed(bench: Any, calm: CampaignFolder) -> None:
    """Workers are killed, then all processes at once; nothing is lost and nothing is twice."""
    out = bench.folder / "out"
    run = started("run", bench.plan(LOGGED), "--out", out, "--workers", 1)
    assert kill_workers(run, out, 1, seed=1) == 1
    written = rows_of(out)
    assert until(lambda: rows_of(out) > written, run)
    run.kill()
    run.communicate()
    before = [k for one in sorted((out / "rows").iterdir()) for k in _indices(one)]
    assert len(before) == len(set(before)) < 8
    assert bench.quadlab("resume", out, "--workers", 1)[0] == 0
    flown = CampaignFolder(out)
    assert rows(flown).equals(rows(calm))
    assert files(flown) == files(calm)
    assert len(set(flown.table()["worker"].to_pylist())) >= 3


def _indices(part: Path) -> list[int]:
    found: list[int] = pq.read_table(part)["index"].to_pylist()
    return found


def test_a_full_disk_ends_the_run_in_one_line_and_the_rest_is_flown_later(
    bench: Any, calm: CampaignFolder
) -> None:
    out = bench.folder / "out"
    size = max(map(len, files(calm))) // 2  # no log can be written

    command = started("run", bench.plan(LOGGED), "--out", out, "--workers", 1, file_size=size)
    _, said = command.communicate()
    assert command.returncode == 1
    line = said.strip().splitlines()[-1]
    assert line.startswith("quadlab: ")
    assert "File too large" in line
    assert "Traceback" not in said
    assert rows_of(out) == 0
    assert [one.name for one in out.glob("**/*.new")] == []
    assert bench.quadlab("resume", out, "--workers", 1)[0] == 0
    assert rows(CampaignFolder(out)).equals(rows(calm))


def test_a_folder_that_is_deleted_while_its_flights_are_flown_is_told(bench: Any) -> None:
    out = bench.folder / "out"
    run = started("run", bench.plan(CASES), "--out", out, "--workers", 1)
    assert until(lambda: rows_of(out) >= 1, run)
    shutil.rmtree(out)
    _, said = run.communicate()
    assert run.returncode == 1
    assert said.strip().splitlines()[-1].startswith(f"quadlab: {out} was deleted or replaced")
    assert "Traceback" not in said
    assert not out.exists()


def test_the_rows_of_a_folder_that_was_replaced_are_left_alone(bench: Any) -> None:
    flown = bench.flown(CASES.replace("= 8", "= 1"), "out")
    shutil.rmtree(flown.path)
    other = bench.flown(CASES.replace("= 8", "= 2"), "out")
    before = rows(other)
    with pytest.raises(Exception, match="was deleted or replaced"):
        flown.finish()
    assert rows(other).equals(before)


def test_a_run_that_is_asked_to_end_says_in_one_line_how_it_goes_on(bench: Any) -> None:
    out = bench.folder / "out"
    run = started("run", bench.plan(CASES.replace("= 8", "= 400")), "--out", out, "--workers", 1)
    assert until(lambda: rows_of(out) >= 1, run)
    workers = workers_of(run.pid)
    run.terminate()
    _, said = run.communicate()
    assert len(workers) == 1
    assert not Path("/proc", str(workers[0])).exists()
    assert run.returncode == 128 + signal.SIGTERM
    told = [line for line in said.splitlines() if " of 400" not in line]  # progress
    assert told == [f"quadlab: SIGTERM: the rows so far are kept; quadlab campaign resume {out}"]
    assert 0 < rows_of(out) < 400


def test_only_the_first_signal_counts_and_one_that_was_ignored_stays_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    kept = []

    def stopped() -> None:
        with kept_when_stopped(tmp_path):
            signal.raise_signal(signal.SIGHUP)
            try:
                signal.raise_signal(signal.SIGINT)
            finally:
                signal.raise_signal(signal.SIGINT)
                signal.raise_signal(signal.SIGTERM)
                kept.append("rows")

    try:
        with pytest.raises(StoppedBySignal) as stop:
            stopped()
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
    assert stop.value.code == 130
    assert kept == ["rows"]
    assert capsys.readouterr().err.count("\n") == 1
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
