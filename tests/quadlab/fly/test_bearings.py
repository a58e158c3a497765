"""`quadlab fly bearings`: flown on bearings alone, judged from the log, reported."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.evaluation.bearings import read_flight
from flight_log import read_log
from flight_log.reader import read_attachments
from quadlab.__main__ import main
from quadrotor.errors import LogFormatError
from vehicle_link.messages import decode

EIGHT = ("experiment.manoeuvre=figure_eight", "experiment.duration=8")


def flown(out: Path, *words: str) -> dict[str, Any]:
    """Return the report of a flight that several tests share."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        main(["fly", *words, "--out", str(out), "--json"])
    report: dict[str, Any] = json.loads(printed.getvalue().strip().splitlines()[-1])
    return report


def estimators(log: Path) -> list[str]:
    """Return the estimators that the vehicle reported to fly on, in order."""
    told = [
        decode(message.payload, "quadlab_msgs/EstimatorStatus").estimator
        for message in read_log(log, {"/quad1/estimator"})
    ]
    return [name for k, name in enumerate(told) if k == 0 or name != told[k - 1]]


def sets(*settings: str) -> list[str]:
    return [word for one in settings for word in ("--set", one)]


def fly(capsys: pytest.CaptureFixture[str], out: Path, *words: str) -> dict[str, Any]:
    main(["fly", "bearings", *words, "--out", str(out), "--json"])
    report: dict[str, Any] = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    return report


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return an 8 on bearings of seed 7, with its report."""
    pytest.importorskip("matplotlib")
    words = ("bearings", *sets(*EIGHT), "--seed", "7", "--report")
    return flown(tmp_path_factory.mktemp("reported"), *words)


@pytest.fixture
def short_hover(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("console.experiments.hover.DURATION", 0.5)  # s; how it flies is irrelevant


def layouts(report: dict[str, Any]) -> tuple[str, str]:
    """Return the layouts of the emulated beacons and of those that the vehicle knows."""
    values = json.loads(read_attachments(Path(report["log"]))["parameters.json"])
    return values["bearings.layout"], values["beacons.layout"]


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
    reported: dict[str, Any], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    again = fly(capsys, tmp_path, *sets(*EIGHT), "--seed", "7")
    messages = [
        [(m.topic, m.publish_ns, m.payload) for m in read_log(Path(report["log"]))]
        for report in (reported, again)
    ]
    assert messages[0] == messages[1]


def test_recorded_sticks_fly_the_complementary_filter(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    rows = ["t,forward,left,up,yaw"]
    rows += [f"{0.5 * k},{0.3 * np.sin(k):.3f},{0.3 * np.cos(k):.3f},0,0.1" for k in range(17)]
    file = tmp_path / "sticks.csv"
    file.write_text("\n".join(rows))
    report = fly(
        capsys,
        tmp_path,
        *sets(
            "experiment.manoeuvre=sticks",
            f"experiment.sticks_file={file}",
            "experiment.estimator=complementary",
        ),
    )
    assert report["verdict"] == "passed"
    assert 7.0 < report["metrics"]["judged_s"] < 12.0
    assert 0.005 < report["metrics"]["position_rms_m"] < 0.055


def test_a_failing_sensor_ends_on_the_tracker_and_fails(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    report = fly(
        capsys,
        tmp_path,
        *sets("experiment.duration=10", "fallback.consistency_max=1.2", "fallback.window=0.2"),
    )
    assert report["metrics"]["fallbacks"] == 1.0
    assert report["verdict"] == "failed"


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


def test_beacons_of_a_file_are_known_to_both_and_gains_whose_limits_nobody_knows_are_not_judged(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "five.csv"
    rows = ["7,1.5,1.5,0.1", "8,-1.5,1.5,0.1", "9,-1.5,-1.5,0.1", "10,1.5,-1.5,0.1", "11,0,0,0.1"]
    file.write_text("\n".join(["id,x,y,z", *rows]))
    settings = sets(
        "experiment.duration=5", "experiment.estimator=complementary", "experiment.gains=bearings"
    )
    words = ("--beacons", str(file), *settings)
    assert main(["fly", "bearings", *words, "--out", str(tmp_path), "--json"]) == 3
    report = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    emulated, known = layouts(report)
    assert known == emulated
    assert known.startswith("7 1.5 1.5 0.1; 8 -1.5")
    assert report["metrics"]["position_rms_m"] < 0.05
    assert report["verdict"] == "not_judged"
    for name in ("position_rms_m", "estimate_position_rms_m", "estimate_attitude_rms_deg"):
        assert name in report["reason"]


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


@pytest.mark.usefixtures("short_hover")
def test_beacons_are_where_they_are_emulated_unless_the_vehicle_is_told_otherwise(
    tmp_path: Path,
) -> None:
    wide = ("hover", *sets("bearings.layout=wide"))
    one = flown(tmp_path, *wide)
    assert layouts(one) == ("wide", "wide")
    other = flown(tmp_path, *wide, *sets("beacons.layout=paper"))
    assert layouts(other) == ("wide", "paper")
    with pytest.raises(LogFormatError, match="never flew on bearings"):
        read_flight(Path(one["log"]), "quad1")


def test_a_coarser_sensor_is_held_to_limits_of_its_own(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    coarse = fly(capsys, tmp_path, *sets("experiment.duration=5", "bearings.sigma=5"))
    assert coarse["metrics"]["position_rms_m"] > 0.025
    assert coarse["verdict"] == "passed"


@pytest.mark.parametrize("estimator", ["error_state", "complementary"])
def test_bearings_that_are_all_turned_fail_by_the_attitude_they_give(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, estimator: str
) -> None:
    turned = fly(
        capsys,
        tmp_path,
        *sets("experiment.duration=5", "bearings.bias_z=3", f"experiment.estimator={estimator}"),
    )
    assert turned["verdict"] == "failed"
    assert turned["metrics"]["fallbacks"] == 0.0
    assert 2.5 < turned["metrics"]["estimate_attitude_rms_deg"] < 3.5


def test_one_beacon_that_is_off_is_named_once_and_left_out(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    report = fly(
        capsys,
        tmp_path,
        *sets("experiment.duration=10"),
        "--seed",
        "7",
        *sets("bearings.beacon_bias=3 0 0 5", "fallback.exclude_beacon=True"),
    )
    told = [
        decode(message.payload, "rcl_interfaces/Log").msg
        for message in read_log(Path(report["log"]), {"/quad1/events"})
    ]
    assert sum("beacon 3" in line for line in told) == 1
    assert not any(f"beacon {id}" in line for id in (1, 2, 4) for line in told)
    statuses = [
        decode(message.payload, "quadlab_msgs/VehicleStatus")
        for message in read_log(Path(report["log"]), {"/quad1/status"})
    ]
    off = [one for one in statuses if "beacon_off" in one.flags]
    assert len(off) > 0.5 * sum("on_bearings" in one.flags for one in statuses)
    assert {(one.suspect_beacon, one.suspect_left_out) for one in off} == {(3, True)}
    assert report["metrics"]["estimate_position_rms_m"] < 0.05  # 0.09 with it
    assert report["metrics"]["estimate_attitude_rms_deg"] < 1.0  # 2.1 with it
