"""`quadlab fly bearings`: flown on bearings alone, judged from the log, reported."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.evaluation.bearings import read_flight
from flight_log import read_log
from quadlab.__main__ import main
from tests.support.flown import flown, sets
from vehicle_link.messages import decode

EIGHT = ("experiment.manoeuvre=figure_eight", "experiment.duration=5")


def estimators(log: Path) -> list[str]:
    """Return the estimators that the vehicle reported to fly on, in order."""
    told = [
        decode(message.payload, "quadlab_msgs/EstimatorStatus").estimator
        for message in read_log(log, {"/quad1/estimator"})
    ]
    return [name for k, name in enumerate(told) if k == 0 or name != told[k - 1]]


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return an 8 on bearings of seed 7, with its report."""
    words = ("bearings", *sets(*EIGHT), "--seed", "7", "--report")
    return flown(tmp_path_factory.mktemp("reported"), *words)


def test_the_eight_on_bearings_is_flown_and_judged(reported: dict[str, Any]) -> None:
    one = reported
    metrics = one["metrics"]
    assert one["verdict"] == "passed"
    assert 0.005 < metrics["position_rms_m"] <= 0.04  # on the tracker it would be 3 mm
    assert 0.004 < metrics["estimate_position_rms_m"] < 0.025
    assert 0.0 < metrics["estimate_attitude_rms_deg"] < 0.5
    assert (metrics["saturated_share"], metrics["fallbacks"]) == (0.0, 0.0)
    assert estimators(Path(one["log"])) == ["complementary", "error_state", "complementary"]

    flight = read_flight(Path(one["log"]), "quad1", 4.0)
    rows = flight.judged
    apart = np.linalg.norm((flight.truth[:, :3] - flight.reference_w)[rows], axis=1)
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(metrics["position_rms_m"])


def test_the_same_seed_gives_the_same_messages_with_and_without_a_report(
    reported: dict[str, Any], tmp_path: Path
) -> None:
    again = flown(tmp_path, "bearings", *sets(*EIGHT), "--seed", "7")
    messages = [
        [(m.topic, m.publish_ns, m.payload) for m in read_log(Path(report["log"]))]
        for report in (reported, again)
    ]
    assert messages[0] == messages[1]


def test_recorded_sticks_fly_the_complementary_filter(tmp_path: Path) -> None:
    rows = ["t,forward,left,up,yaw"]
    rows += [f"{0.5 * k},{0.3 * np.sin(k):.3f},{0.3 * np.cos(k):.3f},0,0.1" for k in range(17)]
    file = tmp_path / "sticks.csv"
    file.write_text("\n".join(rows))
    report = flown(
        tmp_path,
        "bearings",
        *sets(
            "experiment.manoeuvre=sticks",
            f"experiment.sticks_file={file}",
            "experiment.estimator=complementary",
        ),
    )
    assert report["verdict"] == "passed"
    assert 7.0 < report["metrics"]["judged_s"] < 12.0
    assert 0.005 < report["metrics"]["position_rms_m"] < 0.055


def test_the_report_is_a_page_a_paper_four_plots_and_a_table(reported: dict[str, Any]) -> None:
    report = reported
    page, paper, picture, text = (Path(file) for file in report["report"])
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert paper.read_bytes().startswith(b"%PDF")
    assert {file.parent for file in (page, paper, picture, text)} == {Path(report["log"]).parent}
    shown = f"{1e3 * report['metrics']['position_rms_m']:.4g} mm"
    assert f'<td>position rms</td><td class="n">{shown}</td>' in page.read_text()
    assert "Fig. 6 of the paper" in page.read_text()
    written = text.read_text()
    assert f"| position_rms_m | {report['metrics']['position_rms_m']:.5g} | 0.0" in written
    assert "`experiment.manoeuvre` = figure_eight" in written
    assert picture.name in written


def test_a_file_that_holds_no_beacons_is_refused_with_line_and_column(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "wrong.csv"
    file.write_text("id,x,y,z\n1,1,1,0.1\n2,-1,one,0.1\n")
    assert main(["fly", "bearings", "--beacons", str(file), "--out", str(tmp_path)]) == 2
    assert "wrong.csv, line 3, column 6: y is 'one'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--set", "experiment.manoeuvre=loop"], "one of hover, figure_eight, sticks"),
        (["--set", "experiment.duration=1"], "5 to 3600"),
        (["--set", "experiment.manouvre=hover"], "did you mean experiment.manoeuvre"),
        (["--set", "experiment.estimator=magic"], "one of error_state, complementary"),
        (["--set", "experiment.gains=paper"], "of the complementary filter"),
        (["--set", "beacons.layout=1 0 0 0"], "beacons.layout"),
        (["--set", "bearings.layout=1 0 0 0"], "--set: layout of the beacons"),
        (["--set", "bearings.lost=one"], "--set: lost = 'one' names no beacons"),
    ],
)
def test_wrong_words_are_refused_with_what_is_allowed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: list[str], said: str
) -> None:
    assert main(["fly", "bearings", *words, "--out", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err


def test_without_matplotlib_a_report_is_refused_before_the_flight(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["fly", "bearings", "--report", "--out", str(tmp_path)]) == 2
    assert "pip install matplotlib" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
