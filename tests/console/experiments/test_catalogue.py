"""The experiments by name: their order, what is known of them without imports, unknown names."""

from __future__ import annotations

import subprocess
import sys

import pytest

from console.experiments import catalogue
from console.experiments.catalogue import experiments, find
from console.experiments.client import Calibrating
from quadrotor.checkout import PREFIX
from quadrotor.errors import UsageError
from quadrotor.extension import ReportFigures
from quadrotor.extensions import Registry, registry

OWN = [
    *("figure_eight", "hover", "own_behavior", "bearings"),
    *("gyroscope", "accelerometer", "motor_bench", "mass", "inertia"),
]


def test_those_of_quadlab_itself_come_first() -> None:
    assert list(experiments())[: len(OWN)] == OWN


@pytest.mark.parametrize("name", experiments())
def test_each_is_what_its_declaration_says(name: str) -> None:
    experiment = find(name, "quad7")
    assert experiment.name == name
    assert isinstance(experiment, Calibrating) == bool(experiments()[name].offer.calibration)


def test_figures_of_the_report_are_of_experiments() -> None:
    assert set(registry().offers(ReportFigures)) <= set(experiments())


def test_without_extensions_there_are_those_of_quadlab_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(catalogue, "registry", lambda: Registry(()))
    experiments.cache_clear()
    try:
        with pytest.raises(UsageError) as refused:
            find("circles")
    finally:
        experiments.cache_clear()
    assert str(refused.value) == f"unknown experiment 'circles'; there are {', '.join(OWN)}"


def test_a_list_of_them_imports_none() -> None:
    code = (
        f"import sys; from {PREFIX}console.experiments.catalogue import experiments; "
        "print(*experiments()); "
        "print(*(n for n in sys.modules if 'console.experiments.' in n or n == 'numpy'))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names, imported = done.stdout.splitlines()
    assert names.split() == list(experiments())
    assert [one.rpartition(".")[2] for one in imported.split()] == ["catalogue"]
