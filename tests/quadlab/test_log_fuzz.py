"""Mutated logs in the commands: at most a line, a known status, the file unchanged."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from benchmarks.logs.fuzz_logs import MOST_MB, Worker
from quadlab.__main__ import main
from tests.crafted_logs import mutated, sound

COUNT = 24
WORDS = (["log", "info"], ["log", "check"], ["log", "export"], ["replay"], ["log", "recover"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return sound(tmp_path_factory.mktemp("log") / "sound.mcap").read_bytes()


@pytest.mark.parametrize("number", range(COUNT))
def test_a_mutated_log_costs_a_line_and_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], whole: bytes, number: int
) -> None:
    log = tmp_path / "a.mcap"
    log.write_bytes(mutated(whole, number))
    before = log.read_bytes()
    for words in WORDS:
        more = ["--out", str(tmp_path / "out")] if words[-1] == "export" else []
        assert main([*words, str(log), *more]) in (0, 1, 2), words
        assert capsys.readouterr().err.count("\n") <= 1, words
        if words[-1] != "recover":
            assert log.read_bytes() == before, words


def test_the_benchmark_tells_status_and_memory_of_each_command(
    tmp_path: Path, whole: bytes
) -> None:
    log, out = tmp_path / "a.mcap", tmp_path / "out"
    log.write_bytes(whole)
    worker = Worker()
    for command, status in (("info", 0), ("page", 0), ("replay", 1)):
        done = worker.run(command, log, out)
        assert done["status"] == status, done["said"]
        assert 10.0 < done["peak"] < MOST_MB
        shutil.rmtree(out)
    log.write_bytes(b"no log")
    assert worker.run("check", log, out)["status"] == 1
    worker.stop()
