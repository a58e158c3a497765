"""`quadlab fly bearings` with other beacons, another sensor, or one that is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from console.evaluation.bearings import read_flight
from flight_log import read_log
from flight_log.reader import read_attachments
from quadlab.__main__ import main
from quadrotor.errors import LogFormatError
from tests.support.flown import flown, sets
from vehicle_link.messages import decode


@pytest.fixture
def short_hover(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("console.experiments.hover.DURATION", 0.5)  # s; how it flies is irrelevant


def layouts(report: dict[str, Any]) -> tuple[str, str]:
    """Return the layouts of the emulated beacons and of those that the vehicle knows."""
    values = json.loads(read_attachments(Path(report["log"]))["parameters.json"])
    return values["bearings.layout"], values["beacons.layout"]


def test_a_failing_sensor_ends_on_the_tracker_and_fails(tmp_path: Path) -> None:
    report = flown(
        tmp_path,
        "bearings",
        *sets("experiment.duration=10", "fallback.consistency_max=1.2", "fallback.window=0.2"),
    )
    assert report["metrics"]["fallbacks"] == 1.0
    assert report["verdict"] == "failed"


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


def test_a_coarser_sensor_is_held_to_limits_of_its_own(tmp_path: Path) -> None:
    coarse = flown(tmp_path, "bearings", *sets("experiment.duration=5", "bearings.sigma=5"))
    assert coarse["metrics"]["position_rms_m"] > 0.025
    assert coarse["verdict"] == "passed"


@pytest.mark.parametrize("estimator", ["error_state", "complementary"])
def test_bearings_that_are_all_turned_fail_by_the_attitude_they_give(
    tmp_path: Path, estimator: str
) -> None:
    turned = flown(
        tmp_path,
        "bearings",
        *sets("experiment.duration=5", "bearings.bias_z=3", f"experiment.estimator={estimator}"),
    )
    assert turned["verdict"] == "failed"
    assert turned["metrics"]["fallbacks"] == 0.0
    assert 2.5 < turned["metrics"]["estimate_attitude_rms_deg"] < 3.5


def test_one_beacon_that_is_off_is_named_once_and_left_out(tmp_path: Path) -> None:
    report = flown(
        tmp_path,
        "bearings",
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
