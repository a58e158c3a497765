"""Reports made on request: one process at a time, its progress, and the reason of a failure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.runs.report_folders import report_folder
from quadrotor.errors import LogFormatError, StorageError
from web.runs.report_making import ReportMaking


def program(log: Path, report: Callable[[float], None]) -> None:
    report(0.25)
    while log.with_suffix(".wait").exists():
        pass
    if log.read_bytes() == b"torn":
        raise LogFormatError("the log is torn at byte 4")
    folder = report_folder(log)
    folder.mkdir()
    for kind in ("pdf", "html", "html.new"):
        (folder / f"{log.stem}.{kind}").write_text(kind)


@pytest.fixture
def making() -> Iterator[Callable[[float], Any]]:
    made: list[ReportMaking] = []

    def make(seconds: float = 60.0) -> ReportMaking:
        made.append(ReportMaking(program, seconds))
        return made[-1]

    yield make
    for one in made:
        one.stop()


def test_it_tells_its_progress_and_then_its_files(
    making: Any, tmp_path: Path, until: Callable[..., None]
) -> None:
    log, wait = tmp_path / "run.mcap", tmp_path / "run.wait"
    log.write_bytes(b"sound")
    wait.touch()
    reports = making()
    assert reports.state("run").as_json(log) == {
        "state": "none",
        "progress": 0.0,
        "reason": "",
        "files": [],
    }
    first = reports.ask("run", log)
    until(lambda: reports.state("run").progress == 0.25)
    assert reports.ask("run", log) is first, "one under way is enough"
    wait.unlink()
    until(lambda: reports.state("run").name == "ready")
    assert reports.state("run").as_json(log)["files"] == ["run.html", "run.pdf"]


def test_the_last_line_of_one_that_failed_is_the_reason_and_it_can_be_asked_for_again(
    making: Any, tmp_path: Path, until: Callable[..., None]
) -> None:
    log = tmp_path / "run.mcap"
    log.write_bytes(b"torn")
    reports = making()
    reports.ask("run", log)
    until(lambda: reports.state("run").name == "failed")
    assert reports.state("run").reason == "the log is torn at byte 4"
    log.write_bytes(b"sound")
    reports.ask("run", log)
    until(lambda: reports.state("run").name == "ready")
    assert report_folder(log).is_dir()


def test_one_that_takes_too_long_is_ended(
    making: Any, tmp_path: Path, until: Callable[..., None]
) -> None:
    log = tmp_path / "run.mcap"
    log.write_bytes(b"sound")
    log.with_suffix(".wait").touch()
    reports = making(0.2)
    reports.ask("run", log)
    until(lambda: reports.state("run").name == "failed")
    assert reports.state("run").reason == "not done after 0 s"


def test_a_log_that_is_not_there_has_no_report(making: Any, tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="cannot read"):
        making().ask("gone", tmp_path / "gone.mcap")
