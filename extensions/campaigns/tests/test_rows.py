"""Rows: the same with any workers, in any order and after any death; nothing lost, none twice."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from extensions.campaigns.beginning import RECORD
from extensions.campaigns.flights import Outcome
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.run import Progress
from extensions.campaigns.shard import Shard
from extensions.campaigns.tests.conftest import COMPILED, rows
from quadrotor.errors import StorageError

GAINS = COMPILED + '[factors]\n"control.position.kp_xy" = [3.0, 4.0, 5.0]\n'


def test_rows_do_not_depend_on_the_workers_or_on_shards(bench: Any) -> None:
    plan = bench.plan(GAINS)
    one = bench.flown(GAINS, "one")  # in this process
    many = bench.run(plan, "many", "--workers", 2)
    assert rows(one).equals(rows(many))
    # shards of one folder, and of folders of their own
    bench.run(plan, "parts", "--shard", "1/3", "--workers", 1)
    status, said, _ = bench.quadlab("merge", bench.folder / "parts")
    assert status == 0
    assert "5 of 15 flights" in said
    other = bench.flown(GAINS, "other", Shard(2, 3))
    bench.flown(GAINS, "parts", Shard(3, 3))
    assert bench.quadlab("merge", bench.folder / "parts", other.path)[0] == 0
    parts = CampaignFolder(bench.folder / "parts")
    assert rows(parts).equals(rows(one))
    assert [part.name for part in parts.rows.iterdir()] == ["rows.parquet"]
    # the dataset as any reader of Parquet has it
    table = pq.read_table(one.rows)
    assert table.column_names[:5] == [
        "index",
        "seed",
        "control.position.kp_xy",
        "verdict",
        "reason",
    ]
    assert table["index"].to_pylist() == list(range(15))
    assert {"position_rms_m", "wall_s", "processor_s", "worker", "host"} <= {*table.column_names}


def test_the_rate_of_a_run_begins_with_its_first_task() -> None:
    now, lines = [0.0], []
    progress = Progress(100, lambda flown, words: lines.append((flown, words)), lambda: now[0])
    for at, count in ((1000.0, 10), (1002.0, 20), (1004.0, 70)):  # workers start for 1000 s
        now[0] = at
        progress.took([Outcome(k, "passed" if k else "failed") for k in range(count)])
    assert lines == [
        (10, "10 of 100, 1 failed"),
        (30, "30 of 100, 10 a second, 7 s to go, 2 failed"),
        (100, "100 of 100, 22.5 a second, 3 failed"),
    ]


def test_what_is_done_is_not_flown_again(bench: Any) -> None:
    plan = bench.plan(GAINS)
    whole = bench.flown(GAINS, "whole")
    part = bench.flown(GAINS, "part", Shard(1, 2))
    assert part.count() == 8
    assert part.done().tolist() == [k % 2 == 0 for k in range(15)]
    status, said, _ = bench.quadlab("resume", part.path, "--workers", 1)
    assert status == 0
    assert "7 of 15 flights to fly" in said
    assert rows(part).equals(rows(whole))
    assert "0 of 15 flights to fly" in bench.quadlab("run", plan, "--out", part.path)[1]


def test_the_rows_of_a_run_that_was_killed_between_two_renames_are_there(bench: Any) -> None:
    flown = bench.flown(COMPILED, "flown")
    before = rows(flown)
    flown.rows.rename(flown.path / "rows.old")
    (flown.path / "rows.new").mkdir()
    (flown.path / "rows.old" / "rows.parquet").rename(flown.path / "rows.new" / "rows.parquet")
    flown.mend()
    assert rows(flown).equals(before)
    assert not (flown.path / "rows.old").exists()


@pytest.fixture(scope="module")
def hard(tmp_path_factory: pytest.TempPathFactory) -> CampaignFolder:
    """Return a campaign in which flights raise, die and fail."""
    from extensions.campaigns.tests.conftest import Bench

    folder = tmp_path_factory.mktemp("hard")
    bench = Bench(folder, None)  # type: ignore[arg-type]
    cases = ["good", "fails", "raises", "dies", "dies once"]
    plan = bench.plan(
        f'experiment = "cases.py"\n'
        f'[fixed]\n"experiment.folder" = "{folder}"\n'
        f'[factors]\n"experiment.case" = {json.dumps(cases)}\n[keep]\nlogs = "failed"\n'
    )
    words = [sys.executable, "-m", "quadlab", "campaign", "run", str(plan), "--out"]
    done = subprocess.run([*words, str(folder / "out"), "--workers", "2"], check=False)
    assert done.returncode == 1
    return CampaignFolder(folder / "out")


def test_a_flight_that_goes_wrong_is_a_row_with_its_reason(hard: CampaignFolder) -> None:
    found = hard.table()
    assert dict(
        zip(
            found["experiment.case"].to_pylist(),
            zip(found["verdict"].to_pylist(), found["reason"].to_pylist(), strict=True),
            strict=True,
        )
    ) == {
        "good": ("passed", ""),
        "fails": ("failed", "height_m is 1, at most 0.5 passes"),
        "raises": ("raised", "cases.py line 32: ZeroDivisionError: no good"),
        "dies": ("worker_died", "each worker that flew it died"),
        "dies once": ("passed", ""),
    }
    assert found["height_m"].to_pylist() == [1.0, 1.0, None, None, 1.0]


def test_a_flight_that_does_not_end_is_ended(bench: Any) -> None:
    plan = 'experiment = "cases.py"\ntime_limit = 1\n[fixed]\n"experiment.case" = "hangs"\n'
    table = bench.run(bench.plan(plan), "out", "--workers", 1).table()
    assert table["verdict"].to_pylist() == ["timed_out"]
    assert table["reason"].to_pylist() == ["no end within 1 s of wall time"]


def test_the_logs_that_the_plan_keeps_are_those_of_the_commands(
    hard: CampaignFolder, tmp_path: Path
) -> None:
    from extensions.campaigns.summary import summarize

    missed = {one["index"]: one for one in summarize(hard)["not_passed"]["flights"]}
    assert sorted(missed) == [1, 2, 3]
    assert sorted(one.name for one in (hard.path / "logs").iterdir()) == [
        "0000001.mcap",
        "0000002.mcap",
    ]
    words = shlex.split(missed[1]["command"])
    assert words[:2] == ["quadlab", "fly"]
    words = [sys.executable, "-m", *words, "--out", str(tmp_path)]
    assert subprocess.run(words, check=False, capture_output=True).returncode == 1
    (log,) = tmp_path.glob("*.mcap")
    assert log.read_bytes() == hard.log_of(1).read_bytes()


def test_a_changed_plan_is_another_campaign(bench: Any) -> None:
    bench.flown(COMPILED, "out")
    changed = bench.plan(COMPILED.replace("seeds = 5", "seeds = 6"))
    line = bench.refused("run", changed, "--out", bench.folder / "out")
    assert "holds the campaign of another plan" in line
    (bench.folder / "full").mkdir()
    (bench.folder / "full" / "thesis.tex").touch()
    line = bench.refused("run", changed, "--out", bench.folder / "full")
    assert "holds other files; give a new folder" in line
    assert "is no campaign" in bench.refused("show", bench.folder / "full")


def test_the_plan_in_a_folder_is_not_changed_afterwards(bench: Any) -> None:
    flown = bench.flown(COMPILED, "out")
    plan = flown.path / "plan.toml"
    plan.write_text(plan.read_text().replace("seeds = 5", "seeds = 6"))
    assert "plan.toml was changed since" in bench.refused("resume", flown.path)


def test_damaged_rows_are_told_in_one_line(bench: Any) -> None:
    flown = bench.flown(COMPILED, "out")
    next(flown.rows.iterdir()).write_bytes(b"PAR1")
    for action in ("show", "resume"):
        assert "rows is damaged" in bench.refused(action, flown.path)


def test_rows_of_other_software_are_not_mixed_in(bench: Any) -> None:
    flown = bench.flown(COMPILED, "out")
    record = json.loads((flown.path / RECORD).read_text())
    record["software"]["sources"] = "before"
    (flown.path / RECORD).write_text(json.dumps(record))
    line = bench.refused("resume", flown.path)
    assert "was begun with another quadlab (sources before, revision" in line


def test_a_second_run_at_one_folder_is_refused(bench: Any) -> None:
    flown = bench.flown(COMPILED, "out", Shard(1, 2))
    with flown.owned(Shard(1, 2)):
        assert "another run (process" in bench.refused("resume", flown.path)
        assert "another run" in bench.refused("resume", flown.path, "--shard", "1/2")
        assert flown.is_running
        with flown.owned(Shard(2, 2)):  # another part
            assert flown.is_running
    assert not flown.is_running


def test_a_full_disk_is_told_in_one_line_and_nothing_is_half_written(
    bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(table: Any, place: Path) -> None:
        place.write_bytes(b"PAR1")
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(pq, "write_table", full)
        with pytest.raises(StorageError, match=r"cannot be written \(No space left on device\)"):
            bench.flown(COMPILED, "out")
    assert list((bench.folder / "out" / "rows").iterdir()) == []
    assert bench.flown(COMPILED, "out").count() == 5


def test_shards_are_written_i_of_n(bench: Any) -> None:
    for text in ("0/4", "5/4", "2", "a/b"):
        line = bench.refused("run", bench.plan(COMPILED), "--out", "x", "--shard", text)
        assert "write I/N with I from 1 to N" in line


def test_campaigns_of_different_plans_are_not_merged(bench: Any) -> None:
    one = bench.flown(COMPILED, "one")
    two = bench.flown(COMPILED.replace("seeds = 5", "seeds = 6"), "two")
    assert "is of another plan than" in bench.refused("merge", one.path, two.path)


def test_a_folder_without_rows_says_so(bench: Any) -> None:
    flown = bench.flown(COMPILED, "one")
    next(flown.rows.iterdir()).unlink()
    with pytest.raises(StorageError, match="no rows yet"):
        flown.table()


def test_a_folder_that_is_none_is_told_in_one_line(bench: Any) -> None:
    (bench.folder / "file").touch()
    plan = bench.plan(COMPILED)
    assert "Not a directory" in bench.refused("run", plan, "--out", bench.folder / "file")
    flown = bench.flown(COMPILED, "one")
    for text in ("{", "[]", ""):
        (flown.path / "campaign.json").write_text(text)
        assert "campaign.json is damaged" in bench.refused("show", flown.path)


def test_metrics_that_no_flight_has_are_told_at_the_end(bench: Any) -> None:
    plan = 'experiment = "cases.py"\n' + "[limits]\nheight_m = 2.0\nwidth_m = 1.0\n"
    bench.flown(plan, "out")
    status, _, said = bench.quadlab("resume", bench.folder / "out")
    assert status == 1
    assert said == "quadlab: no flight has 'width_m'; correct metrics or limits\n"
