"""`quadlab fly`: verdict, metrics from the log alone, and the same bytes for the same seed."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from console.experiments import figure_eight, hover
from flight_log import read_log
from tests.support.flown import flown
from tests.support.rates import RATES


@pytest.fixture(scope="module")
def eight(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return one figure 8 with full sensors."""
    return flown(tmp_path_factory.mktemp("eight"), "figure_eight")


@pytest.fixture(scope="module")
def short_hover() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hover, "DURATION", 3.0)  # s
        yield


@pytest.fixture(scope="module")
def hovered(tmp_path_factory: pytest.TempPathFactory, short_hover: None) -> dict[str, Any]:
    """Return one hover of seed 4."""
    return flown(tmp_path_factory.mktemp("hover"), "hover", "--seed", "4")


@pytest.fixture(scope="module")
def heavy(tmp_path_factory: pytest.TempPathFactory, short_hover: None) -> dict[str, Any]:
    """Return one flight of another seed, with a mass that the vehicle does not know."""
    words = (
        "--seed",
        "5",
        "--set",
        "simulator.mass=1.6",
        "control.limits.position_integral_max=0.01",
    )
    return flown(tmp_path_factory.mktemp("heavy"), "hover", *words)


def test_the_eight_with_full_sensors_stays_within_its_errors(eight: dict[str, Any]) -> None:
    metrics = eight["metrics"]
    assert eight["verdict"] == "passed"
    assert metrics["samples"] > 1500
    assert metrics["position_rms_m"] <= 0.005
    assert metrics["position_max_m"] <= 0.009
    assert metrics["yaw_rms_deg"] <= 0.4


def test_with_the_true_state_only_the_motors_lag_remains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figure_eight, "LAPS", 2)  # of which one is steady
    report = flown(tmp_path, "figure_eight", "--true-state")
    assert report["metrics"]["position_rms_m"] <= 0.002


def test_the_log_holds_every_topic_at_its_rate(eight: dict[str, Any]) -> None:
    counts: Counter[str] = Counter()
    for message in read_log(Path(eight["log"])):
        counts[message.topic.removeprefix("/quad1/")] += 1
    seconds = eight["metrics"]["flown_s"]
    for topic, rate in RATES.items():
        assert counts[topic] / seconds == pytest.approx(rate, rel=0.05), topic
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
    hovered: dict[str, Any], heavy: dict[str, Any], tmp_path: Path
) -> None:
    def messages(
        report: dict[str, Any], topics: set[str] | None = None
    ) -> dict[str, list[tuple[int, int, bytes]]]:
        found = defaultdict(list)
        for message in read_log(Path(report["log"]), topics):
            found[message.topic].append((message.log_ns, message.publish_ns, message.payload))
        return found

    first = messages(hovered)
    again = messages(flown(tmp_path, "hover", "--seed", "4"))
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
    assert heavy["metrics"]["at_bound_s"] > 5.0  # its integral cannot carry the mass
    assert "at_bound_s" not in hovered["metrics"]
    assert heavy["metrics"]["position_rms_m"] > 5 * hovered["metrics"]["position_rms_m"]
