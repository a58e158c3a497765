"""`quadlab new`: the files that it writes run and pass their own tests."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from console.experiments.user_file import load
from control.trajectories.library import files_of, load_files
from estimation import names
from quadlab.__main__ import main
from quadrotor.checkout import ROOT
from tests.support.installed import install
from tests.support.lab import Lab, flight_parameters
from vehicle.estimators.offer import offer_estimators
from vehicle.laws.laws import Laws


@pytest.fixture
def no_names_left() -> Iterator[None]:
    yield
    names.offer(())


def test_a_new_law_estimator_behavior_and_sensor_fly_and_pass_their_own_tests(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], no_names_left: None
) -> None:
    folder = tmp_path / "plugins"
    assert main(["new", "law", "mine", "--out", str(folder)]) == 0
    assert f"--set control.law=mine --plugins {folder}" in capsys.readouterr().out
    assert main(["new", "estimator", "own", "--out", str(folder)]) == 0
    assert f"--set estimation.estimator=own --plugins {folder}" in capsys.readouterr().out
    assert main(["new", "behavior", "turn", "--out", str(folder)]) == 0
    assert f"--set behavior.plugin=turn --plugins {folder}" in capsys.readouterr().out
    assert main(["new", "sensor", "height", "--out", str(folder)]) == 0
    assert f"estimation.sensors=height --plugins {folder}" in capsys.readouterr().out
    assert Laws(folder).names() == (*Laws().names(), "mine")
    offer_estimators(folder)
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder)]
    tested = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert "9 passed" in tested.stdout, tested.stdout
    parameters = flight_parameters()
    parameters.control.law, parameters.estimation.estimator = "mine", "own"
    parameters.estimation.plugin.built_in = "error_state"
    parameters.behavior.plugin, parameters.estimation.sensors = "turn", "height"
    lab = Lab(parameters, plugins=folder).hovering(settling=1.0)
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.03)
    assert lab.parameter("control.law") == "mine"
    assert lab.parameter("estimation.estimator") == "own"
    (sensor,) = lab.stack.own_sensors.externals
    assert (sensor.used > 20, sensor.refused, sensor.failure) == (True, 0, "")
    lab.start("external")
    lab.wait(1.0)
    assert lab.view().behavior == "external"
    assert lab.robot.truth["position_w"][0, 1] == pytest.approx(0.25, abs=0.03)
    lab.stack.close()


def test_a_new_experiment_and_a_new_trajectory_are_found_where_they_are_written(
    tmp_path: Path,
) -> None:
    for kind in ("experiment", "trajectory"):
        assert main(["new", kind, "mine", "--out", str(tmp_path / kind)]) == 0
    assert load(tmp_path / "experiment" / "mine.py").name == "mine"
    trajectories, refused = load_files(files_of(tmp_path / "trajectory"))
    assert (list(trajectories), refused) == (["mine"], [])


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["law", "3x"], "begin with a letter"),
        (["law", "test_x"], "but not with test_"),
        (["law", "geometric"], "built-in law"),
        (["estimator", "error_state"], "built-in estimator"),
        (["experiment", "hover"], "built-in experiment"),
        (["lawn", "x"], "did you mean law"),
    ],
)
def test_a_name_that_cannot_be_is_refused_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], why: str
) -> None:
    assert main(["new", *words, "--out", str(tmp_path)]) == 2
    assert why in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_never_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text("kept")
    assert main(["new", "law", "mine", "--out", str(tmp_path)]) == 1
    assert "exists already" in capsys.readouterr().err
    assert (tmp_path / "mine.py").read_text() == "kept"


def test_a_new_extension_passes_its_tests_and_is_a_tracking_system_and_a_part_of_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "extension", "mine", "--out", str(tmp_path)]) == 0
    assert "quadlab tracker mine" in capsys.readouterr().out
    folder = tmp_path / "mine"
    assert "starlight" not in "".join(one.read_text().lower() for one in folder.rglob("*.*"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder)]
        tested = subprocess.run(
            words,
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
            env={**os.environ, "PYTHONPATH": str(folder)},
        )
        assert "7 passed" in tested.stdout, tested.stdout
        declared = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
        (group,) = declared["entry-points"]
        lines = [f"{name} = {value}" for name, value in declared["entry-points"][group].items()]
        install(patch, folder, {group: "\n".join(lines)}, {})
        shown = subprocess.run(
            [sys.executable, "-c", INSTALLED, str(folder)],
            capture_output=True,
            text=True,
            check=True,
        )
    assert shown.stdout.split() == ["mine", "['mine']", "[]"]


INSTALLED = """
import sys
sys.path.insert(0, sys.argv[1])
import quadlab
from quadlab.commands.tracker import SYSTEMS
from web.features import of_extensions, panels_of_extensions
from web.static_files import files_with
print("mine" if "mine" in SYSTEMS else "")
print([one.name for one in of_extensions(print) if one.name == "mine"])
files = files_with(tuple(panels_of_extensions()))
assert b'id="tab-mine"' in files.document("console/index.html").body
print(files.problems)
"""


@pytest.mark.parametrize(
    ("name", "why"),
    [("mavlinkx-", "use letters"), ("json", "is that of a module"), ("test_a", "but not with")],
)
def test_a_name_that_an_extension_cannot_have_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, why: str
) -> None:
    assert main(["new", "extension", name, "--out", str(tmp_path)]) == 2
    assert why in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
