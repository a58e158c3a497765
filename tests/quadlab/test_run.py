"""Runs in scripts and notebooks: the log's numbers, with units, windows and errors."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadlab
from flight_log import read_log
from quadlab.run import Run
from quadlab.simulated.flight_log import FlightLog
from quadrotor.errors import StorageError, UsageError
from quadrotor.parameters import ParameterStore
from quadrotor.records import JUDGED_READING, TICK
from tests.support.lab import flight_parameters
from vehicle_link.messages import decode

Z = "pose.pose.position.z"
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("flights")
    return quadlab.fly("hover", seed=3, set={"control.preset": "stiff"}, out=folder)


def test_a_flight_gives_its_verdict_and_its_topics(run: Run) -> None:
    assert run.result is not None
    assert run.result.verdict == "passed"
    assert {"state", "imu", "truth", "tracker_pose"} <= set(run)
    assert "state" in run
    assert run.metadata["experiment"] == "hover"
    assert run.parameters["control.position.kp_xy"] == 6.0
    assert any("take off" in line.text for line in run.events)


def test_a_topic_is_the_messages_of_the_log_bit_for_bit(run: Run) -> None:
    state = run["state"]
    messages = list(read_log(run.path, {"/quad1/state"}))
    assert len(state) == len(messages)
    for k in (0, len(messages) // 2, -1):
        message: Any = decode(messages[k].payload, messages[k].type_name)
        assert state[Z][k] == message.pose.pose.position.z
        assert state["stamp_ns"][k] == messages[k].publish_ns
    assert state.units[Z] == "m"
    assert state.units["time"] == "s"
    assert state.numpy("time", Z).shape == (len(state), 2)


def test_a_window_and_other_times_are_the_same_flight(run: Run) -> None:
    state = run["state"]
    part = state.window(5.0, 6.0)
    assert 0 < len(part) < len(state)
    assert (part["time"][0] >= 5.0, part["time"][-1] <= 6.0) == (True, True)
    middle = 0.5 * (part["time"][:-1] + part["time"][1:])
    joined = part.at(middle)
    assert joined[Z] == pytest.approx(0.5 * (part[Z][:-1] + part[Z][1:]), abs=1e-12)
    assert joined.units == part.units
    assert np.isnan(part.at([0.0, 5.5, 99.0])[Z]).tolist() == [True, False, True]


def test_readings_of_a_sensor_of_the_users_own_are_a_table(tmp_path: Path) -> None:
    log = FlightLog(tmp_path / "a.mcap", "quad1", ParameterStore(flight_parameters()), {})
    tick, judged = np.zeros(1, TICK), np.zeros(1, JUDGED_READING)
    judged["place"], judged["sensor"], judged["reading"] = 1, "Höhe".encode(), 1.5
    for k in range(20):
        tick["imu"]["stamp_ns"] = 2_000_000 * (k + 1)
        log.tick(tick)
        judged["stamp_ns"], judged["residual"] = 2_000_000 * k, 0.1 * k
        log.readings([judged])
    log.close()
    table = quadlab.open(log.path)["sensor_1"]
    assert table["expected"] == pytest.approx(1.5 - 0.1 * np.arange(20))
    assert set(table["sensor"]) == {"Höhe"}
    assert table["stamp_ns"].tolist() == (2_000_000 * np.arange(20)).tolist()
    assert {"reading", "residual", "gate", "deviation", "judgement"} < set(table.columns)


def test_errors_are_those_of_state_against_truth(run: Run) -> None:
    found = run.errors()
    state, truth = run["state"], run["truth"]
    axes = [f"pose.pose.position.{axis}" for axis in "xyz"]
    true = np.stack([np.interp(state["stamp_ns"], truth["stamp_ns"], truth[a]) for a in axes], 1)
    apart = np.linalg.norm(state.numpy(*axes) - true, axis=1)
    late = np.isin(found.stamps_ns, state.window(10.0, 20.0)["stamp_ns"])
    mine = apart[np.isin(state["stamp_ns"], found.stamps_ns[late])]
    assert found.position[late] == pytest.approx(mine, abs=1e-4)
    assert found.metrics()["position_rms_m"] == pytest.approx(0.0, abs=0.02)


def test_a_run_is_found_by_name_and_a_wrong_one_is_told_with_the_newest(
    run: Run, tmp_path: Path
) -> None:
    (tmp_path / "runs" / "r1").mkdir(parents=True)
    (tmp_path / "runs" / "r1" / "station.mcap").symlink_to(run.path)
    assert len(quadlab.open("r1", data=tmp_path)["imu"]) == len(run["imu"])
    assert quadlab.open(run.path).duration == run.duration
    with pytest.raises(StorageError, match=r"no run 'r2'.*newest runs of .* are r1"):
        quadlab.open("r2", data=tmp_path)


def test_wrong_words_are_refused_with_what_there_is(run: Run) -> None:
    with pytest.raises(UsageError, match="stat"):
        run["stat"]
    with pytest.raises(UsageError, match="no column 'z'; there are time, stamp_ns"):
        run["state"]["z"]
    with pytest.raises(UsageError, match="from 6 to 5 s"):
        run["state"].window(6.0, 5.0)
    with pytest.raises(UsageError, match="unknown experiment 'hoover'"):
        quadlab.fly("hoover")
    with pytest.raises(AttributeError, match="nothing"):
        quadlab.nothing  # noqa: B018 - the access is the test


def test_importing_the_package_loads_nothing_of_it() -> None:
    code = "import sys, quadlab; print('numba' in sys.modules, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def example(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def executed(name: str, changes: Mapping[str, str]) -> dict[str, Any]:
    """Run the cells of a notebook, with changes to its text; return its names."""
    cells = json.loads((EXAMPLES / f"{name}.ipynb").read_text())["cells"]
    source = "\n".join("".join(one["source"]) for one in cells if one["cell_type"] == "code")
    for old, new in changes.items():
        assert source.count(old) == 1
        source = source.replace(old, new)
    names: dict[str, Any] = {}
    import matplotlib as mpl

    with mpl.rc_context({"backend": "agg"}):
        exec(compile(source, name, "exec"), names)
    return names


def test_the_notebook_reads_a_run(
    run: Run, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(quadlab, "fly", lambda experiment, seed, out: run)
    names = executed("read_run", {})
    told = capsys.readouterr().out
    assert re.search(r"^highest point: 1\.\d+ m$", told, re.MULTILINE)
    assert "take off by" in told
    (line,) = names["axes"].lines
    assert 1e-3 * np.max(line.get_ydata()) == pytest.approx(run.errors().position.max())


def test_the_notebook_of_a_batch_draws_how_error_grows_with_force() -> None:
    names = executed("batch_study", {"FLIGHTS = 100": "FLIGHTS = 1"})
    (line,) = names["axes"].lines
    assert line.get_ydata().tolist() == sorted(names["middle"])
    assert len(names["middle"]) == 5


@pytest.mark.parametrize("path", [*EXAMPLES.glob("*.ipynb")], ids=lambda path: path.stem)
def test_a_notebook_shows_the_results_of_all_its_cells_in_order(path: Path) -> None:
    cells = json.loads(path.read_text())["cells"]
    code = [one for one in cells if one["cell_type"] == "code"]
    assert [one["execution_count"] for one in code] == list(range(1, len(code) + 1))
    outputs = [output for one in code for output in one["outputs"]]
    assert all(one["output_type"] != "error" for one in outputs)
    assert any("image/png" in one.get("data", {}) for one in outputs)


def test_every_example_that_runs_alone_is_short() -> None:
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text().splitlines()) <= 60, path.name


def test_the_example_compares_gain_sets(
    run: Run, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[tuple[int, object]] = []

    def fly(experiment: str, *, seed: int, set: Mapping[str, object], out: Path) -> Run:
        flown.append((seed, set["control.preset"]))
        return run

    monkeypatch.setattr(quadlab, "fly", fly)
    example("compare_seeds").main(2)
    assert flown == [(1, "standard"), (2, "standard"), (1, "stiff"), (2, "stiff")]
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in rows] == ["standard", "stiff"]
    assert all(0.5 < float(row[2]) < 10.0 for row in rows)
