"""Experiments and trajectories of installed packages are found by the names of entry points."""

from __future__ import annotations

from pathlib import Path

import pytest

from quadlab.simulated.experiment import chosen
from quadrotor.checkout import ROOT
from quadrotor.errors import UsageError
from tests.support.installed import install
from tests.support.lab import flight_parameters
from vehicle.flight.process import load_trajectories
from vehicle.flight.stack import FlightStack


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    examples = {
        "some/step.py": (ROOT / "examples/experiments/side_step.py").read_text(),
        "some/coil.py": (ROOT / "examples/trajectories/spiral.py").read_text(),
    }
    points = {
        "quadlab.experiments": "packed_step = some.step",
        "quadlab.trajectories": "coil = some.coil",
    }
    install(monkeypatch, tmp_path, points, {"some/__init__.py": "", **examples})


def test_quadlab_fly_takes_an_experiment_of_a_package_by_name(package: None) -> None:
    assert chosen("packed_step").name == "side_step"
    with pytest.raises(UsageError, match=r"unknown experiment .*packed_step, and your own files"):
        chosen("packed_stop")


def test_a_trajectory_of_a_package_is_loaded_beside_those_of_the_folder(
    package: None, tmp_path: Path
) -> None:
    stack = FlightStack(flight_parameters())
    folder = tmp_path / "trajectories"
    folder.mkdir()
    (folder / "mine.py").write_text((ROOT / "examples/trajectories/spiral.py").read_text())
    load_trajectories(stack, folder)
    assert set(stack.behaviors.trajectories) == {"mine", "coil"}
