"""The version of the contract that a plugin's file states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from quadrotor.checkout import ROOT
from quadrotor.errors import UsageError
from vehicle.behaviors.contract import BEHAVIOR
from vehicle.estimators.contract import ESTIMATOR
from vehicle.laws.contract import LAW
from vehicle.plugins.host import load
from vehicle.sensors.contract import SENSOR

LATER = replace(LAW, protocol=3, changes={1: "return the torque before the thrust", 2: "rename m"})
FILE = """
class law:
    def reset(self): ...
    def step(self, x): return 0.0, [0.0, 0.0, 0.0]
"""


def written(folder: Path, line: str) -> Path:
    path = folder / "mine.py"
    path.write_text(FILE + line)
    return path


@pytest.mark.parametrize("line", ["", "PROTOCOL = 1\n"])
def test_a_file_that_states_none_is_of_the_first(tmp_path: Path, line: str) -> None:
    assert load(LAW, written(tmp_path, line)).step(None)[0] == 0.0
    with pytest.raises(UsageError) as caught:
        load(LATER, written(tmp_path, line))
    assert str(caught.value) == (
        "mine.py: PROTOCOL = 1, and this vehicle speaks protocol 3 with a law: return the torque "
        "before the thrust; rename m; then write PROTOCOL = 3"
    )


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("PROTOCOL = 2", "PROTOCOL = 2, .* with a law: rename m; then write PROTOCOL = 3"),
        ("PROTOCOL = 4", "PROTOCOL = 4, .*: it was written for a later quadlab: update"),
        ("PROTOCOL = '3'", "PROTOCOL = '3', .*: write PROTOCOL = 3"),
    ],
)
def test_a_file_of_another_protocol_is_told_what_to_change(
    tmp_path: Path, line: str, why: str
) -> None:
    with pytest.raises(UsageError, match=f"^mine.py: {why}"):
        load(LATER, written(tmp_path, line))


def test_what_quadlab_new_writes_states_the_protocol_that_is_spoken() -> None:
    for contract, name in (
        (LAW, "laws/geometric_pid"),
        (ESTIMATOR, "estimators/error_state_ekf"),
        (BEHAVIOR, "behaviors/sway"),
        (SENSOR, "sensors/barometer"),
    ):
        lines = (ROOT / "examples" / f"{name}.py").read_text().splitlines()
        stated = [line for line in lines if line.startswith("PROTOCOL = ")]
        assert [line.split("#")[0].strip() for line in stated] == [
            f"PROTOCOL = {contract.protocol}"
        ]
