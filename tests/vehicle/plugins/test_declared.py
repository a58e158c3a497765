"""Parameters of plugins: read from packages without running anything of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from quadrotor.parameter_description import ParameterDescription
from quadrotor.parameters import ParameterStore
from tests.support.installed import install
from vehicle.parameters import new_parameters
from vehicle.plugins import declared

OPTIONS = """
from quadrotor.parameters import Parameters, parameter

raise RuntimeError("nothing of it may run")

class Options(Parameters):
    gain: float = parameter(4.0, unit="1/s", ge=0.0, le=20.0)
    '''from error to velocity'''
"""


@pytest.fixture(autouse=True)
def nothing_left() -> Iterator[None]:
    yield
    declared.offer(None)


def described() -> dict[str, ParameterDescription]:
    """Return the parameters of plugins in a new tree, without their first word."""
    found = ParameterStore(new_parameters()).descriptions()
    own = "plugins."
    return {one.name.removeprefix(own): one for one in found if one.name.startswith(own)}


def test_a_packages_parameters_are_the_vehicles_and_nothing_of_it_is_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fails = "raise RuntimeError"
    lines = "mine = some.laws.pid:Law\ngone = some.nowhere:Law"
    files = {"some/__init__.py": fails, "some/laws/__init__.py": fails, "some/laws/pid.py": OPTIONS}
    install(monkeypatch, tmp_path, {"quadlab.laws": lines}, files)
    assert declared.offer(None) == []
    one = described()["mine.gain"]
    assert (one.default, one.unit, one.maximum) == (4.0, "1/s", 20.0)
    assert one.description == "from error to velocity"
