"""Faults on the command line: one text for all parts, and a refusal in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from quadlab.__main__ import main
from quadlab.settings import parse_settings, split_faults
from quadlab.simulated.parameters import FlightParameters, faults_to_come
from quadlab.up.child_words import child_words
from quadrotor.errors import UsageError

ALL = "tracker.freeze from=3; barometer.ramp rate=15; bearings.lens"


def test_one_text_sets_the_faults_of_simulator_tracker_and_bearings() -> None:
    parameters = FlightParameters().model_copy(deep=True)
    parse_settings(parameters, [f"faults={ALL}", "simulator.mass=1.2"])
    assert parameters.tracker.faults == "tracker.freeze from=3"
    assert parameters.simulator.faults == "barometer.ramp rate=15"
    assert parameters.bearings.faults == "bearings.lens"
    assert split_faults([f"faults={ALL}", "model.mass=1.2"]) == (
        ["simulator.faults=barometer.ramp rate=15", "model.mass=1.2"],
        ["tracker.faults=tracker.freeze from=3", "bearings.faults=bearings.lens"],
    )


def words_of(faults: str, tmp_path: Path, tracker: str = "", *, is_served: bool = False) -> object:
    return child_words("mikrokopter", [f"faults={faults}"], tmp_path, tracker, is_served)


def test_up_gives_each_process_the_faults_that_it_has(tmp_path: Path) -> None:
    tracker, bearings = "tracker.faults=tracker.freeze from=3", "bearings.faults=bearings.lens"
    simulator = "faults=barometer.ramp rate=15"
    assert words_of(ALL, tmp_path) == (
        *([], ["--set", simulator], ["--set", tracker, "--set", bearings], {}),
    )
    # A served tracker is the simulator's own.
    assert words_of(ALL, tmp_path, "vrpn", is_served=True) == (
        *([], ["--set", simulator, "--set", tracker], ["--set", bearings], {}),
    )
    with pytest.raises(UsageError, match="turns the simulated tracker off"):
        words_of(ALL, tmp_path, "udp")


def test_up_feeds_forward_the_drag_that_is_identified_in_a_rough_world(tmp_path: Path) -> None:
    words = ["simulator.preset=rough", "model.drag=0.3"]
    found = child_words("mikrokopter", words, tmp_path, "", is_served=False)
    assert found.values == {"model.drag": 0.3, "model.drag_lever": 0.02}
    assert found.simulator == ["--set", "preset=rough"]
    assert child_words("mikrokopter", words[:1], tmp_path, "", is_served=False).values == {
        "model.drag": 0.47,
        "model.drag_lever": 0.02,
    }


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["up", "--set", "faults=tracker.freez"], "did you mean tracker.freeze"),
        (["up", "--set", "faults=bananas"], "docs/how_to/faults.md lists them all"),
        (["fly", "hover", "--set", "faults=imu.stuck axis=w"], "x, y, z"),
        (["fly", "hover", "--set", "simulator.faults=tracker.freeze"], "it belongs in tracker.f"),
        (["fly", "hover", "--set", "bearings.faults=bearings.lens k=9"], "-0.3 to 0.3 1/rad²"),
        (["simulator", "--folder", ".", "--set", "faults=world.wall to=0"], "never begins"),
    ],
)
def test_a_wrong_fault_is_refused_in_one_line_by_every_command(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("quadlab: ")
    assert said in line


def test_a_fault_that_begins_after_the_end_of_the_flight_is_told() -> None:
    parameters = FlightParameters().model_copy(deep=True)
    parameters.tracker.faults = "tracker.freeze from=3 to=4; tracker.drift from=300"
    parameters.simulator.faults = "imu.scale from=23.3"
    assert faults_to_come(parameters, 23.2) == ["imu.scale from=23.3", "tracker.drift from=300"]
    assert faults_to_come(parameters, 301.0) == []
