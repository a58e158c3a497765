"""`quadlab calibrate` at a scripted station: followed, answered, decided; wrong words refused."""

from __future__ import annotations

import io
import math
import os
import queue
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from quadlab import station_client
from quadlab.__main__ import main
from quadlab.calibration import dialogue as calibration_dialogue
from quadlab.calibration.screen import Screen
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import LinkError, RefusedError
from quadrotor.parameters import Parameters, ParameterStore, parameter
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters, to_descriptor

FOUND = CalibrationRecord(
    name="motor",
    values={"model.motor_offset": 11.25},
    figures=(Quality(name="thrust", value=6.0, unit="N"),),
    quality=(Quality(name="root law worst", value=0.1, unit="count", limit=0.2),),
    residuals=(("step 3, count", -0.1), ("step 4, count", 0.02)),
    warnings=("without a tachometer the time constant is not known",),
    conditions={"battery": "16.5 V"},
)
BEFORE = CalibrationRecord(
    name="motor",
    values={"model.motor_offset": 14.0},
    requester="grace",
    stamp_ns=10**18,
    quality=(Quality(name="root law worst", value=0.15, unit="count", limit=0.2),),
)


class Options(Parameters):
    hold: float = parameter(5.0, unit="s", ge=1.0, le=60.0, description="of each reference")


class ScriptedStation:
    """Scripted station; an experiment is a list of statuses, and a question waits."""

    requester = "ada (terminal)"

    def __init__(self) -> None:
        self.statuses: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.asked: list[tuple[str, Any]] = []
        self.refused: dict[str, str] = {}
        self.force = [BEFORE]
        self.flights: list[list[dict[str, Any]]] = []
        self._left: list[dict[str, Any]] = []

    def status(self, **fields: Any) -> None:
        ours = {"name": "motor_bench", "phase": "flying", "requester": self.requester}
        fields = {**ours, **fields}
        self.statuses.put(new("quadlab_msgs/ExperimentStatus", **fields))

    def ask(self, service: str, *, action: str, **fields: Any) -> Any:
        options = from_parameters(fields.get("options", []))
        self.asked.append((action, options))
        if action in self.refused:
            raise RefusedError(self.refused[action])
        if action == "describe":
            [description] = ParameterStore(Options()).descriptions()
            hold = to_descriptor(description)
            hold.name = "motor_bench.hold"
            return new(
                "quadlab_msgs/srv/Experiment_Response",
                descriptors=[hold],
                names=["hover", "motor_bench", "gyroscope", "mine.py"],
                descriptions=["", "", "", ""],
                calibrations=["", "motor", "gyroscope", ""],
                problems=["", "", "", "mine.py line 3: SyntaxError"],
            )
        if action == "in_force":
            records = [one.model_dump_json() for one in self.force]
            return new("quadlab_msgs/srv/Calibrate_Response", records=records)
        if action == "start":
            self._left = list(self.flights.pop(0))
        if action in ("start", "confirm"):
            self._go_on()
        if action == "stop":
            self.status(phase="stopped", reason="stopped by ada")
        return None

    def _go_on(self) -> None:
        while self._left:
            fields = self._left.pop(0)
            self.status(**fields)
            if fields.get("question"):
                return

    def parameters(self) -> dict[str, Any]:
        return {"model.motor_offset": 14.5}

    def actions(self) -> list[str]:
        return [action for action, _ in self.asked if action not in ("describe", "in_force")]


ASKS: dict[str, Any] = {"question": "Propellers clear?"}
PASSES: list[dict[str, Any]] = [
    {"instruction": "Rest", "step_number": 1, "step_count": 2},
    {"instruction": "Hold", "step_number": 2, "step_count": 2, "step_share": 0.5},
    {"phase": "passed", "proposal": FOUND.model_dump_json()},
]


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> ScriptedStation:
    made = ScriptedStation()

    @contextmanager
    def station(port: int, vehicle: str) -> Iterator[ScriptedStation]:
        yield made

    monkeypatch.setattr(station_client, "station", station)
    monkeypatch.setattr(calibration_dialogue, "SILENT", 0.2)
    return made


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Return a function that types lines at a terminal and returns the prompts shown."""

    def type_in(*lines: str | BaseException) -> list[str]:
        prompts: list[str] = []
        left = list(lines)

        def ask(self: Screen, prompt: str, is_open: Callable[[], bool]) -> str | None:
            prompts.append(prompt)
            line = left.pop(0)
            if isinstance(line, BaseException):
                raise line
            return line if is_open() else None

        plain = Screen.__init__

        def begin(self: Screen) -> None:
            plain(self)
            self.is_terminal = True

        monkeypatch.setattr(Screen, "__init__", begin)
        monkeypatch.setattr(Screen, "ask", ask)
        return prompts

    return type_in


def test_without_a_name_it_says_what_is_in_force_and_what_cannot_run(
    scripted: ScriptedStation, capsys: pytest.CaptureFixture[str]
) -> None:
    scripted.force.append(CalibrationRecord(name="gyroscope", requester="start"))
    assert main(["calibrate"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split()[0] == "motor_bench"
    assert "by grace  root law worst 0.15 count" in lines[0]
    assert "by the vehicle at its start" in lines[1]
    assert lines[2] == "mine.py cannot run: mine.py line 3: SyntaxError"
    assert len(lines) == 3


def test_a_script_starts_confirms_and_accepts(
    scripted: ScriptedStation, capsys: pytest.CaptureFixture[str]
) -> None:
    scripted.flights = [[*PASSES[:2], ASKS, *PASSES[2:]]]
    assert main(["calibrate", "motor_bench", "--accept", "--yes", "--set", "hold=2"]) == 0
    assert scripted.actions() == ["start", "confirm", "accept"]
    assert ("start", {"hold": 2.0}) in scripted.asked
    assert ("confirm", ASKS) in scripted.asked
    out = capsys.readouterr().out
    for line in ("Propellers clear? yes", "[1/2] Rest", "[2/2] Hold", "motor_bench: passed"):
        assert line in out.splitlines()
    rows = [line.split() for line in out.splitlines()]
    assert ["model.motor_offset", "14.5", "11.25"] in rows
    assert ["thrust", "–", "6", "N"] in rows
    assert "root law worst      0.15 count  0.1 count  good (at most 0.2 count)" in out
    assert "warning: without a tachometer" in out
    assert "largest residual: step 3, count: -0.1" in out


def test_a_script_rejects(scripted: ScriptedStation) -> None:
    scripted.flights = [PASSES]
    assert main(["calibrate", "motor_bench", "--reject"]) == 1
    assert scripted.actions() == ["start", "reject"]


def test_a_script_never_accepts_what_is_beyond_its_limits(scripted: ScriptedStation) -> None:
    bad = FOUND.model_copy(update={"quality": (Quality(name="worst", value=9, limit=0.2),)})
    scripted.flights = [[{}, {"phase": "passed", "proposal": bad.model_dump_json()}]]
    assert main(["calibrate", "motor_bench", "--accept"]) == 1
    assert scripted.actions() == ["start", "reject"]


@pytest.mark.parametrize(
    ("flight", "refused", "stream", "said"),
    [
        (PASSES, {"accept": "on the ground only"}, "out", "not accepted: on the ground only"),
        ([{}, {"phase": "failed", "reason": "no data"}], {}, "out", "motor_bench: failed: no data"),
        ([{"instruction": "Rest"}], {}, "err", "the station has been silent"),
        ([], {"start": "mass is running"}, "err", "mass is running"),
    ],
)
def test_what_ends_without_being_accepted_is_told(
    scripted: ScriptedStation,
    capsys: pytest.CaptureFixture[str],
    flight: list[dict[str, Any]],
    refused: dict[str, str],
    stream: str,
    said: str,
) -> None:
    scripted.flights, scripted.refused = [flight], refused
    assert main(["calibrate", "motor_bench", "--accept"]) == 1
    assert said in getattr(capsys.readouterr(), stream)


def test_a_person_confirms_repeats_and_accepts(
    scripted: ScriptedStation, typed: Callable[..., list[str]]
) -> None:
    scripted.flights = [[ASKS, *PASSES], [ASKS, *PASSES]]
    prompts = typed("y", "what", "rep", "yes", "a")
    assert main(["calibrate", "motor_bench"]) == 0
    assert scripted.actions() == ["start", "confirm", "reject", "start", "confirm", "accept"]
    assert prompts[0] == "Propellers clear? [y/N]"


def test_a_person_who_is_refused_decides_again(
    scripted: ScriptedStation, typed: Callable[..., list[str]]
) -> None:
    scripted.flights, scripted.refused = [PASSES], {"accept": "airborne"}
    typed("accept", "reject")
    assert main(["calibrate", "motor_bench"]) == 1
    assert scripted.actions() == ["start", "accept", "reject"]


@pytest.mark.parametrize("answer", ["", "n", "no"])
def test_anything_but_yes_stops_it(
    scripted: ScriptedStation, typed: Callable[..., list[str]], answer: str
) -> None:
    scripted.flights = [[ASKS, *PASSES]]
    typed(answer)
    assert main(["calibrate", "motor_bench"]) == 1
    assert scripted.actions() == ["start", "stop"]


def test_control_c_stops_it_on_the_station_too(
    scripted: ScriptedStation, typed: Callable[..., list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    scripted.flights = [[ASKS, *PASSES], PASSES]
    typed(KeyboardInterrupt(), KeyboardInterrupt())
    assert main(["calibrate", "motor_bench"]) == 130
    assert scripted.actions() == ["start", "stop"]
    assert "stopped; nothing was stored" in capsys.readouterr().out
    assert main(["calibrate", "motor_bench"]) == 130
    assert scripted.actions() == ["start", "stop", "start"]
    assert "the proposal stays open" in capsys.readouterr().out


@pytest.mark.parametrize(
    "later", [{"name": "", "phase": "idle", "requester": ""}, {"requester": "grace"}]
)
def test_a_station_that_started_anew_ends_it(
    scripted: ScriptedStation, capsys: pytest.CaptureFixture[str], later: dict[str, Any]
) -> None:
    scripted.flights = [[PASSES[0], later, *PASSES[1:]]]
    assert main(["calibrate", "motor_bench", "--accept"]) == 1
    assert "the station has restarted or runs another" in capsys.readouterr().err
    assert scripted.actions() == ["start"]


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["motor_bench"], 2, "there is no terminal to answer on: give --accept or --reject"),
        (["motor_bench", "--accept", "--reject"], 2, "give one of them"),
        (["--accept"], 2, "need a calibration"),
        (["--set", "hold=2"], 2, "need a calibration"),
        (
            ["motor", "--accept"],
            2,
            "no calibration 'motor'; did you mean motor_bench? known are motor_bench, gyroscope",
        ),
        (["hover", "--accept"], 2, "no calibration 'hover'"),
        (["mine.py", "--accept"], 2, "mine.py cannot run: mine.py line 3: SyntaxError"),
        (["motor_bench", "--accept", "--set", "hold"], 2, "write it as NAME=VALUE"),
        (["motor_bench", "--accept", "--set", "holds=2"], 2, "no option 'holds'; there are hold"),
        (["gyroscope", "--accept", "--set", "hold=2"], 2, "it has none"),
        (["motor_bench", "--accept", "--set", "hold=0"], 2, "allowed 1 to 60 s"),
        (["motor_bench", "--accept", "--set", "hold=long"], 2, "must be a number"),
        (["motor_bench", "--accept", "--name", "Q 1"], 2, "--name"),
    ],
)
def test_wrong_words_are_one_line_and_start_nothing(
    scripted: ScriptedStation,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    status: int,
    said: str,
) -> None:
    assert main(["calibrate", *words]) == status
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert scripted.actions() == []


def test_a_question_without_anybody_to_answer_stops_it(
    scripted: ScriptedStation, capsys: pytest.CaptureFixture[str]
) -> None:
    scripted.flights = [[ASKS, *PASSES]]
    assert main(["calibrate", "motor_bench", "--accept"]) == 2
    assert "it asks: 'Propellers clear?'; there is no terminal" in capsys.readouterr().err
    assert scripted.actions() == ["start", "stop"]


def test_without_a_station_one_line_says_what_to_start(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody(port: int, timeout: float) -> Any:
        raise LinkError("nobody")

    monkeypatch.setattr(station_client, "loopback_session", nobody)
    assert main(["calibrate", "--loopback-port", "18999"]) == 1
    err = capsys.readouterr().err
    assert "no station answers at 127.0.0.1:18999; start `quadlab up`" in err
    assert err.count("\n") == 1


def test_a_question_that_is_answered_elsewhere_is_asked_no_longer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reader, writer = os.pipe()
    with os.fdopen(reader) as ours, os.fdopen(writer, "w") as theirs:
        monkeypatch.setattr(sys, "stdin", ours)
        screen = Screen()
        looks = iter([True, False])
        assert screen.ask("sure?", lambda: next(looks)) is None
        theirs.write(" YES \n")
        theirs.flush()
        assert screen.ask("sure?", lambda: True) == "yes"
        theirs.close()
        assert screen.ask("sure?", lambda: True) is None


def test_on_a_terminal_the_newest_state_is_shown_with_its_figures(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    screen = Screen()
    screen.is_terminal = True
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    shown: list[str] = []
    monkeypatch.setattr(screen, "_show", shown.append)
    screen.progress(
        new(
            "quadlab_msgs/ExperimentStatus",
            instruction="Hold",
            step_number=1,
            step_count=2,
            step_share=0.5,
            elapsed=12.0,
            live_names=["force", "pose 1 x"],
            live_values=[1.5, math.nan],
            live_units=["N", ""],
        )
    )
    assert shown[0].splitlines() == [
        "[1/2] Hold",
        "━" * 15 + "─" * 15 + "    12 s",
        "  force: 1.5 N",
    ]
