"""`quadlab fly FILE.py`: a user's own experiment in simulated time, its rules and its mistakes."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from console.experiments.catalogue import experiments
from flight_log import read_log
from quadlab.__main__ import main
from quadrotor.checkout import ROOT
from vehicle_link.messages import decode

EXAMPLE = ROOT / "examples/experiments/side_step.py"
OWN = """
from console.experiments.client import Result
from quadrotor.parameters import Parameters, parameter

class Options(Parameters):
    ceiling: float = parameter(0.5, unit="m", ge=0.1, le=2.0, description="of the abort rule")
    missing: str = parameter("", description="what the precondition says")
    mistake: bool = parameter(False, description="whether fly divides by zero")

class Mine:
    name, planned = "mine", 10.0
    def __init__(self, vehicle):
        self.parameters = Options()
    def check(self): ...
    def preconditions(self, view):
        return self.parameters.missing
    def abort(self, view):
        return "too high" if view.position_w[2] > self.parameters.ceiling else ""
    def fly(self, client):
        client.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
        client.wait(0.5)
        if self.parameters.mistake:
            1 / 0
        client.arm()
        client.wait(1.0)
        client.start("take_off", height=0.8)
        client.wait(10.0)
    def evaluate(self, log):
        raise ValueError("nothing here")
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "own.py"
    path.write_text(OWN)
    return path


def events(log: Path) -> list[str]:
    found = read_log(log, {"/quad1/events"})
    return [decode(message.payload, "rcl_interfaces/Log").msg for message in found]


def fly(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, Any, str]:
    """Return the exit status, the report, and the error."""
    status = main(["fly", *words, "--json"])
    out, complaint = capsys.readouterr()
    return status, json.loads(out.splitlines()[-1]) if out else None, complaint


def test_the_example_is_flown_like_a_built_in_one(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    status, report, _ = fly(
        capsys, str(EXAMPLE), "--out", str(tmp_path), "--set", "experiment.length=0.3"
    )
    assert (status, report["verdict"], report["experiment"]) == (0, "passed", "side_step")
    assert report["metrics"]["overshoot_m"] < 0.05
    assert "proposal" not in report


def test_the_abort_rule_brakes_lands_and_fails_with_its_reason(
    capsys: pytest.CaptureFixture[str], own: Path, tmp_path: Path
) -> None:
    status, report, _ = fly(capsys, str(own), "--out", str(tmp_path))
    assert (status, report["verdict"]) == (1, "failed")
    assert report["reason"] == "aborted: too high"
    told = events(Path(report["log"]))
    assert Counter(told)["touched down"] == 1
    assert told.index("brake by experiment") < told.index("land by experiment")


def test_a_precondition_that_is_not_met_commands_nothing(
    capsys: pytest.CaptureFixture[str], own: Path, tmp_path: Path
) -> None:
    words = "--out", str(tmp_path), "--set", "experiment.missing=no net is up"
    status, _, complaint = fly(capsys, str(own), *words)
    assert status == 1
    assert "not started: no net is up; the log is kept:" in complaint
    assert not any("armed" in event for event in events(tmp_path / "mine_seed1.mcap"))


def test_a_mistake_in_the_file_is_told_with_its_line_and_the_log_is_kept(
    capsys: pytest.CaptureFixture[str], own: Path, tmp_path: Path
) -> None:
    words = "--out", str(tmp_path), "--set", "experiment.mistake=true"
    status, _, complaint = fly(capsys, str(own), *words)
    log = tmp_path / "mine_seed1.mcap"
    line = 1 + OWN[: OWN.index("1 / 0")].count("\n")
    assert status == 1
    assert f"own.py line {line}: ZeroDivisionError: division by zero; the log is kept: {log}" in (
        complaint
    )
    assert len(complaint.strip().splitlines()) == 1
    assert sum(1 for _ in read_log(log)) > 500


def test_a_wrong_name_lists_what_there_is_and_how_to_give_a_file(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["fly", "hoover"]) == 2
    said = capsys.readouterr().err
    assert all(name in said for name in experiments())
    assert "quadlab fly FILE.py" in said
    assert main(["fly", "absent.py"]) == 1
    assert "absent.py cannot be read: No such file" in capsys.readouterr().err


def test_help_names_every_built_in_experiment(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["fly", "--help"])
    said = capsys.readouterr().out
    assert all(name in said for name in experiments())
    assert "FILE.py" in said
