"""`quadlab fly --vehicles N`: several vehicles in one simulated time."""

from __future__ import annotations

import json
import threading
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest

from console.evaluation.result import Result
from console.reports import writer
from flight_log import read_log
from quadlab.__main__ import main
from quadlab.commands.fly import write_reports
from quadlab.simulated.downwash import CORE, DIAMETER, downward_push, jet_speed
from quadlab.simulated.meeting import Meeting
from quadlab.simulated.neighbours import starts
from quadlab.simulated.together import seed_of, worst
from tests.support.flown import flown
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

HOP = '''
from console.evaluation.verdict import judged
from console.experiments.manoeuvres import arm, land, take_off, wait_ready
from quadrotor.errors import RefusedError


class Hop:
    """Takes off and lands; quad2 flies into quad3, whose experiment fails in the air."""

    name = "hop"
    parameters = None
    planned = 10.0

    def __init__(self, vehicle):
        self.vehicle = vehicle

    def check(self):
        pass

    def fly(self, client):
        wait_ready(client)
        arm(client)
        take_off(client, 0.5)
        if self.vehicle == "quad2":
            client.start("fly_to", x=2.0, y=1.6, z=0.5, yaw=0.0)
            client.wait(4.0)
        if self.vehicle == "quad3":
            client.wait(1.0)
            raise RefusedError("it has had enough")
        land(client)

    def evaluate(self, log):
        return judged({"figure": 1.0}, {"figure": 2.0})
'''
Messages = dict[str, list[tuple[int, int, bytes]]]


@pytest.fixture(scope="module")
def hop(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("experiment") / "hop.py"
    path.write_text(HOP)
    return str(path)


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory, hop: str) -> dict[str, Any]:
    """Return a flight of three vehicles."""
    return flown(tmp_path_factory.mktemp("three"), hop, "--seed", "3", "--vehicles", "3")


def test_the_reports_are_that_of_each_log_and_what_the_experiment_writes_of_all(
    three: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    logs = {name: Path(one["log"]) for name, one in three["vehicles"].items()}
    answers = {name: SimpleNamespace(result=Result("passed", {}, {})) for name in logs}

    class OfAll:
        def report_together(self, *given: Any) -> list[Path]:
            assert given == (logs, {name: one.result for name, one in answers.items()}, ANY, folder)
            assert given[2].verdict == "failed"
            return [folder / "all.md"]

    folder = Path(three["folder"])
    monkeypatch.setattr(
        writer, "report_writer", lambda: lambda log, out, **_: [out / f"{log.stem}.html"]
    )
    done: Any = SimpleNamespace(
        experiment=OfAll(), folder=folder, logs=logs, answers=answers, verdict="failed"
    )
    done.metrics, done.limits, done.reason = {}, {}, "they touched"
    files = [folder / f"{name}.html" for name in logs]
    assert write_reports(done) == [*files, folder / "all.md"]
    done.experiment = object()
    assert write_reports(done) == files


def _messages(log: str) -> Messages:
    found = defaultdict(list)
    for message in read_log(Path(log)):
        found[message.topic].append((message.log_ns, message.publish_ns, message.payload))
    return found


def test_a_vehicle_without_neighbours_in_sight_flies_as_alone(
    three: dict[str, Any], hop: str, tmp_path: Path
) -> None:
    alone = _messages(flown(tmp_path, hop, "--seed", "3")["log"])
    first = _messages(three["vehicles"]["quad1"]["log"])
    assert alone.keys() == first.keys()
    for topic in alone:
        assert alone[topic] == first[topic], topic
    second = _messages(three["vehicles"]["quad2"]["log"])
    assert second["/quad2/imu"][0] != first["/quad1/imu"][0]  # a seed of its own


def test_the_same_seed_gives_the_same_messages_of_all_vehicles(
    three: dict[str, Any], hop: str, tmp_path: Path
) -> None:
    again = flown(tmp_path, hop, "--seed", "3", "--vehicles", "3")
    for name, vehicle in three["vehicles"].items():
        assert _messages(vehicle["log"]) == _messages(again["vehicles"][name]["log"]), name


def test_a_collision_is_told_by_name_and_fails_the_flight(three: dict[str, Any]) -> None:
    assert three["verdict"] == "failed"
    assert "quad2 and quad3 collided at" in three["reason"]
    assert three["metrics"]["collisions"] == 1.0
    assert three["metrics"]["separation_min_m"] < 0.75
    events = _messages(three["vehicles"]["quad3"]["log"])["/quad3/events"]
    assert any(b"collision with quad2" in payload for _, _, payload in events)
    assert three["vehicles"]["quad1"]["separations"]["quad3"] > 1.9


def test_a_vehicle_whose_experiment_fails_comes_down_and_the_others_fly_on(
    three: dict[str, Any],
) -> None:
    vehicles = three["vehicles"]
    assert vehicles["quad1"]["verdict"] == "passed"
    assert vehicles["quad3"]["verdict"] == "failed"
    assert vehicles["quad3"]["reason"] == "it has had enough"
    assert "quad3: it has had enough" in three["reason"]
    assert vehicles["quad3"]["metrics"]["impact_m_s"] < 0.5


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--vehicles", "0"), "--vehicles 0 is not possible; allowed are 1 to 8"),
        (("--vehicles", "many"), "--vehicles: 'many' is not a whole number"),
        (("--vehicles", "1000"), "--vehicles 1000 is not possible; allowed are 1 to 8"),
        (
            ("--vehicles", "2", "--set", "quad3.simulator.payload=0.1"),
            "--set quad3.simulator.payload=0.1: there is no quad3; there are quad1, quad2",
        ),
        (
            ("--vehicles", "2", "--set", "simulator.start_x=1", "simulator.start_y=0"),
            "quad1 and quad2 would start 0.00 m apart; more than 0.75 m are needed",
        ),
        (("--vehicles", "2", "--seed", "-1"), "--seed -1: allowed 0 to"),
        (
            ("--vehicles", "2", "--set", "quad2.simulator.payload=9"),
            "--set simulator.payload=9: simulator.payload = 9",
        ),
    ],
)
def test_what_is_not_possible_is_one_line(
    words: tuple[str, ...], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fly", "hover", *words]) == 2
    told = capsys.readouterr().err.strip()
    assert line in told
    assert "\n" not in told


def test_vehicles_start_apart_and_the_first_one_where_it_starts_alone() -> None:
    places = np.array(starts(8))
    assert places[0].tolist() == [0.0, 0.0]
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert apart[~np.eye(8, dtype=bool)].min() == pytest.approx(2.0)
    assert np.abs(places).max() <= 2.0  # within the flight volume


def test_each_vehicle_has_its_own_seed() -> None:
    seeds = [seed_of(7, index) for index in range(8)]
    assert seeds[0] == 7
    assert len({seed + offset for seed in seeds for offset in (0, 1_000_003, 2_000_003)}) == 24


def test_processes_read_the_rows_of_the_same_meeting() -> None:
    """Vehicles 0 and 1 of one process leave earlier than vehicle 2 of another."""
    files, seen = Meeting.new_files(3, 2), [[], []]  # type: ignore[var-annotated]

    def fly(process: int, own: list[int], meetings: int) -> None:
        meeting = Meeting(files, 3, own)
        for number in range(meetings):
            for k in own:
                row = meeting.rows[k]._replace(stamp_ns=number, mail=bytes([k]) * (number % 5))
                meeting.leave_row(k, row)
            meeting.meet()
            seen[process].append([(row.stamp_ns, row.mail) for row in meeting.rows])
        meeting.leave()

    threads = [
        threading.Thread(target=fly, args=(0, [0, 1], 40), daemon=True),
        threading.Thread(target=fly, args=(1, [2], 60), daemon=True),
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30.0)
        assert not thread.is_alive()
    assert seen[0] == seen[1][:40]
    for number, rows in enumerate(seen[1]):
        last = min(number, 39)
        assert rows == [
            *((last, bytes([k]) * (last % 5)) for k in (0, 1)),
            (number, bytes([2]) * (number % 5)),
        ]


def test_vehicles_of_one_process_see_each_other_as_they_were_at_the_meeting_too() -> None:
    meeting = Meeting(Meeting.new_files(2, 1), 2, [0, 1])
    for number in (1, 2):
        for k in (0, 1):  # the first one flies on before the second one has looked
            assert [row.stamp_ns for row in meeting.rows] == [number - 1, number - 1]
            meeting.leave_row(k, meeting.rows[k]._replace(stamp_ns=number))
        meeting.meet()


def test_the_jet_beneath_a_vehicle_keeps_its_momentum_and_ends_beside_it() -> None:
    thrust = 12.8
    core = jet_speed(thrust, 1.0, 0.0)
    assert core == pytest.approx(jet_speed(thrust, CORE * DIAMETER, 0.0))
    assert jet_speed(thrust, 2.0 * CORE * DIAMETER, 0.0) == pytest.approx(0.5 * core)
    assert jet_speed(4.0 * thrust, 1.0, 0.0) == pytest.approx(2.0 * core)
    assert jet_speed(thrust, 1.0, 0.2) < core
    assert jet_speed(thrust, 1.0, 2.0) == jet_speed(thrust, -1.0, 0.0) == 0.0
    assert downward_push(core) == pytest.approx(1.9, abs=0.05)


def test_the_air_of_others_adds_to_the_other_forces_until_it_ends() -> None:
    simulated = SimulatedVehicle(SimulatorParameters(push_x=2.0))
    force_w = simulated._plant["disturbance_w"][0]
    simulated.blow_on((0.0, 0.0, -1.5))
    assert force_w.tolist() == [2.0, 0.0, -1.5]
    simulated.configure(SimulatorParameters(push_x=1.0))
    assert force_w.tolist() == [1.0, 0.0, -1.5]
    simulated.blow_on((0.0, 0.0, 0.0))
    assert force_w.tolist() == [1.0, 0.0, 0.0]
    simulated.close()


def test_the_worst_verdict_counts_and_names_the_vehicle() -> None:
    merged = worst(
        {
            "quad1": Result("passed", {"error": 1.0, "other": 3.0}, {"error": 2.0}),
            "quad2": Result("failed", {"error": 4.0}, {"error": 2.0}),
            "quad3": Result("not_judged", {}, {}, "no figure has a limit"),
        }
    )
    assert merged == Result("failed", {"error": 4.0}, {"error": 2.0}, "quad2: beyond its limits")
    assert json.dumps(merged.metrics)
