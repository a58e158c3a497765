"""Compiled code is never older than any source it was made from."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from quadrotor import compiled as module
from quadrotor.checkout import ROOT

LAW = """
from quadrotor.compiled import compiled
from control.gain import GAIN, double

@compiled
def law(x):
    return GAIN * double(x)

print(law(3.0), sum(law.stats.cache_hits.values()))
"""
GAIN = """
from quadrotor.compiled import compiled

GAIN = {gain}

@compiled
def double(x):
    return {factor} * x
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the vocabulary with one law that uses a constant and a function of a file."""
    shutil.copytree(ROOT / "quadrotor", tmp_path / "quadrotor")
    (tmp_path / "control").mkdir()
    (tmp_path / "control" / "law.py").write_text(LAW)
    return tmp_path


def law(project: Path, gain: float, factor: float) -> list[str]:
    (project / "control" / "gain.py").write_text(GAIN.format(gain=gain, factor=factor))
    # -B: Python's own cache tells two versions of the same second and length not apart.
    command = [sys.executable, "-B", "-c", "import control.law"]
    return subprocess.run(
        command,
        cwd=project,
        env={"PYTHONPATH": str(project), "PATH": ""},
        check=True,
        capture_output=True,
        text=True,
        timeout=120,
    ).stdout.split()


def test_a_changed_callee_or_constant_of_another_file_is_compiled_anew(project: Path) -> None:
    assert law(project, 5.0, 2.0) == ["30.0", "0"]
    assert law(project, 5.0, 2.0) == ["30.0", "1"]  # loaded
    assert law(project, 7.0, 2.0) == ["42.0", "0"]
    assert law(project, 7.0, 3.0) == ["63.0", "0"]
    assert law(project, 5.0, 2.0) == ["30.0", "1"]  # the old version was kept


def test_the_digest_follows_imports_through_files() -> None:
    direct = module.digest("control.controller")
    assert direct != module.digest("control.allocation")
    assert direct == module.digest("control.controller")
    assert "quadrotor.vehicle_model" in module._source("control.allocation")[1]


def test_division_by_zero_gives_no_exception() -> None:
    from quadrotor.vectors import normalized

    assert all(math.isnan(x) for x in normalized((0.0, 0.0, 0.0, 0.0)))
