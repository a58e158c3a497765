"""Judgement of a flown run in a separate process, and the place of its report."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from console.evaluation.alignment import between
from console.evaluation.verdict import evaluated
from console.experiment_running.evaluation import EvaluationJob, judge
from console.experiments.bearings import BearingsExperiment
from console.experiments.hover import Hover
from console.runs.report_folders import has_report, read_result, report_file, report_folder
from quadlab.__main__ import main
from quadrotor.errors import JobError, QuadlabError, RefusedError, StorageError


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of a short flight on bearings, in simulated time."""
    folder = tmp_path_factory.mktemp("flights")
    main(["fly", "bearings", "--set", "experiment.duration=5", "--out", str(folder)])
    [path] = folder.glob("*.mcap")
    return path


def test_a_run_is_judged_and_its_report_lies_beside_it(log: Path) -> None:
    experiment = BearingsExperiment()
    experiment.parameters.duration = 5.0
    done = judge(EvaluationJob(experiment, log, 150.0), threading.Event())
    here = evaluated(experiment, log)
    assert (done.result, done.problem) == (here, "")
    assert 0.0 < here.metrics["position_rms_m"] < 0.1
    assert done.files == (f"{log.stem}.png", f"{log.stem}.md")
    assert report_folder(log) == log.parent / f"{log.stem}_report"
    assert report_file(log, done.files[0]).read_bytes().startswith(b"\x89PNG")
    assert has_report(log)
    result = read_result(log)
    assert result["verdict"] == here.verdict
    assert result["options"]["duration"] == 5.0
    assert result["metrics"] == done.result.metrics
    assert json.loads((report_folder(log) / "result.json").read_text()) == result


def test_the_page_of_the_whole_run_follows_the_verdict(log: Path) -> None:
    page, end = report_folder(log) / f"{log.stem}.html", time.monotonic() + 150.0
    while not page.exists() and time.monotonic() < end:
        threading.Event().wait(0.05)
    written = page.read_text()
    rms = 1e3 * read_result(log)["metrics"]["position_rms_m"]
    assert f'<td class="n">{rms:.4g} mm</td>' in written
    assert "judged after the flight (result.json)" in written
    assert "Fig. 6 of the paper" in written


def test_what_cannot_be_judged_says_why(log: Path) -> None:
    with pytest.raises(QuadlabError, match="the hover was not flown to its end"):
        judge(EvaluationJob(Hover(), log, 60.0), threading.Event())


def test_an_evaluation_has_its_time_and_can_be_stopped(log: Path) -> None:
    with pytest.raises(JobError, match="not done after 0 s"):
        judge(EvaluationJob(BearingsExperiment(), log, 0.0), threading.Event())
    cancelled = threading.Event()
    cancelled.set()
    with pytest.raises(RefusedError, match="was stopped"):
        judge(EvaluationJob(BearingsExperiment(), log, 60.0), cancelled)


@pytest.mark.parametrize(
    "name",
    ["../x.mcap", "..", ".", "", "/etc/passwd", "result.json/..", "none.png", "a\\b", "a\0b"],
)
def test_no_name_leads_out_of_the_report(tmp_path: Path, name: str) -> None:
    run = tmp_path / "run.mcap"
    (tmp_path / "x.mcap").write_bytes(b"x")
    report_folder(run).mkdir()
    (report_folder(run) / "result.json").write_text("{}")
    (report_folder(run) / "link").symlink_to(tmp_path / "x.mcap")
    assert report_file(run, "result.json").is_file()
    for bad in (name, "link"):
        with pytest.raises(StorageError, match="has no file"):
            report_file(run, bad)


def test_a_run_without_a_report_says_so(tmp_path: Path) -> None:
    run = tmp_path / "run.mcap"
    assert not has_report(run)
    with pytest.raises(StorageError, match="no experiment was judged"):
        read_result(run)
    report_folder(run).mkdir()
    (report_folder(run) / "result.json").write_text("{")
    with pytest.raises(StorageError, match="cannot be read"):
        read_result(run)


def test_values_between_messages_are_interpolated_and_never_over_a_gap() -> None:
    ms = 1_000_000
    messages = {
        0: np.array([0.0, 1.0]),
        2 * ms: np.array([1.0, 3.0]),
        50 * ms: np.array([9.0, 9.0]),
    }
    stamps = np.array([-1, 0, ms, 2 * ms, 30 * ms, 50 * ms, 51 * ms])
    values, known = between(stamps, np.array(list(messages)), np.array(list(messages.values())))
    assert known.tolist() == [False, True, True, True, False, True, False]
    assert values[1:4].tolist() == [[0.0, 1.0], [0.5, 2.0], [1.0, 3.0]]
    assert np.isnan(values[[0, 4, 6]]).all()
    nothing, unknown = between(stamps, np.zeros(0, np.int64), np.zeros((0, 2)))
    assert nothing.shape == (7, 2)
    assert not unknown.any()
