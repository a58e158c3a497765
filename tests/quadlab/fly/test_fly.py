"""`quadlab fly`: verdict, metrics from the log alone, and the same bytes for the same seed."""

from __future__ import annotations

import contextlib
import io
import json
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from flight_log import read_log
from quadlab.__main__ import main
from tests.support.rates import RATES


def fly(capsys: pytest.CaptureFixture[str], out: Path, *words: str) -> dict[str, Any]:
    main(["fly", *words, "--out", str(out), "--json"])
    report: dict[str, Any] = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    return report


def flown(out: Path, *words: str) -> dict[str, Any]:
    """Return the report of a flight that several tests share."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        main(["fly", *words, "--json", "--out", str(out)])
    report: dict[str, Any] = json.loads(printed.getvalue().strip().splitlines()[-1])
    return report


@pytest.fixture(scope="module")
def eight(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return one figure 8 with full sensors."""
    return flown(tmp_path_factory.mktemp("eight"), "figure_eight")


@pytest.fixture(scope="module")
def hovered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return one hover of seed 4."""
    return flown(tmp_path_factory.mktemp("hover"), "hover", "--seed", "4")


@pytest.fixture(scope="module")
def heavy(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return one flight of another seed, with a mass that the vehicle does not know."""
    words = ("--seed", "5", "--set", "simulator.mass=1.6")
    return flown(tmp_path_factory.mktemp("heavy"), "hover", *words)


def test_the_eight_with_full_sensors_stays_within_its_errors(eight: dict[str, Any]) -> None:
    metrics = eight["metrics"]
    assert eight["verdict"] == "passed"
    assert metrics["samples"] > 1500
    assert metrics["position_rms_m"] <= 0.005
    assert metrics["position_max_m"] <= 0.009
    assert metrics["yaw_rms_deg"] <= 0.4


def test_with_the_true_state_only_the_motors_lag_remains(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    report = fly(capsys, tmp_path, "figure_eight", "--true-state")
    assert report["metrics"]["position_rms_m"] <= 0.002


def test_the_log_holds_every_topic_at_its_rate(eight: dict[str, Any]) -> None:
    counts: Counter[str] = Counter()
    for message in read_log(Path(eight["log"])):
        counts[message.topic.removeprefix("/quad1/")] += 1
    flown = eight["metrics"]["flown_s"]
    for topic, rate in RATES.items():
        assert counts[topic] / flown == pytest.approx(rate, rel=0.05), topic
    assert counts["events"] >= 5


def test_another_reader_opens_the_log_and_finds_what_was_flown(eight: dict[str, Any]) -> None:
    heights = []
    with AnyReader([Path(eight["log"])]) as reader:
        connections = [c for c in reader.connections if c.topic == "/quad1/truth"]
        for connection, _, raw in reader.messages(connections):
            truth: Any = reader.deserialize(raw, connection.msgtype)
            heights.append(truth.pose.pose.position.z)
    assert max(heights) == pytest.approx(1.2, abs=0.02)
    assert heights[-1] == pytest.approx(0.0, abs=0.02)


def test_the_same_seed_gives_the_same_messages_byte_for_byte(
    hovered: dict[str, Any],
    heavy: dict[str, Any],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    def messages(
        report: dict[str, Any], topics: set[str] | None = None
    ) -> dict[str, list[tuple[int, int, bytes]]]:
        found = defaultdict(list)
        for message in read_log(Path(report["log"]), topics):
            found[message.topic].append((message.log_ns, message.publish_ns, message.payload))
        return found

    first = messages(hovered)
    again = messages(fly(capsys, tmp_path, "hover", "--seed", "4"))
    assert first.keys() == again.keys()
    for topic in first:
        assert first[topic] == again[topic], topic
    other = messages(heavy, {"/quad1/imu"})
    at_rest = slice(200)  # where the mass has no effect
    assert first["/quad1/imu"][at_rest] != other["/quad1/imu"][at_rest]


def test_a_set_parameter_reaches_the_vehicle_and_the_log(
    hovered: dict[str, Any], heavy: dict[str, Any]
) -> None:
    assert heavy["verdict"] == "failed"
    assert heavy["metrics"]["position_rms_m"] > 5 * hovered["metrics"]["position_rms_m"]
