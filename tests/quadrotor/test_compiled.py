"""Compiled code is never older than any source from which it was made."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from control.behaviors.ground import rest_reference
from quadrotor import compiled as module
from quadrotor.checkout import ROOT
from quadrotor.records import new_reference, new_state, new_tick

LAW = """
import sys
from quadrotor.compiled import compiled
from control.gain import GAIN, double

@compiled
def law(x):
    return GAIN * double(x)

print(law(3.0), sum(law.stats.cache_hits.values()), "numba.np.linalg" in sys.modules)
"""
GAIN = """
from quadrotor.compiled import compiled

GAIN = {gain}

@compiled
def double(x):
    return {factor} * x
"""


SERVER = """
import os
import sys
import quadrotor.compiled

for _ in sys.stdin:
    if os.fork() == 0:
        import control.law
        sys.stdout.flush()
        os._exit(0)
    print(os.wait()[1], flush=True)
"""
"""Program that imports the law again for each line, in a separate process that has numba loaded."""


@pytest.fixture
def law(tmp_path: Path) -> Iterator[Callable[[float, float], list[str]]]:
    """Yield `law(gain, factor)`, which returns the output of a law.

    The law uses a constant and a function of a file, in a copy of the package.
    """
    shutil.copytree(ROOT / "quadrotor", tmp_path / "quadrotor")
    (tmp_path / "control").mkdir()
    (tmp_path / "control" / "__init__.py").touch()  # else the checkout's is found first
    (tmp_path / "control" / "law.py").write_text(LAW)
    # -B: Python's own cache does not distinguish two versions of the same second and length.
    with subprocess.Popen(
        [sys.executable, "-B", "-c", SERVER],
        cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path), "PATH": ""},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as server:
        assert server.stdin is not None
        assert server.stdout is not None
        asked, answers = server.stdin, server.stdout

        def ask(gain: float, factor: float) -> list[str]:
            text = GAIN.format(gain=gain, factor=factor)
            (tmp_path / "control" / "gain.py").write_text(text)
            print(file=asked, flush=True)
            printed = answers.readline().split()
            assert len(printed) > 1, "the import failed"
            assert answers.readline() == "0\n", "the import failed"
            return printed

        yield ask
        asked.close()


def test_a_changed_callee_or_constant_of_another_file_is_compiled_anew(
    law: Callable[[float, float], list[str]],
) -> None:
    compiled, loaded = ["0", "True"], ["1", "False"]  # False: without what only compiling needs
    assert law(5.0, 2.0) == ["30.0", *compiled]
    assert law(5.0, 2.0) == ["30.0", *loaded]
    assert law(7.0, 2.0) == ["42.0", *compiled]
    assert law(7.0, 3.0) == ["63.0", *compiled]
    assert law(5.0, 2.0) == ["30.0", *loaded]  # the old version was still cached


def test_the_digest_follows_imports_through_files() -> None:
    direct = module.digest("control.geometric_law")
    assert direct != module.digest("control.allocation")
    assert direct == module.digest("control.geometric_law")
    assert "quadrotor.vehicle_model" in module._source("control.allocation")[1]


def test_division_by_zero_gives_no_exception() -> None:
    from quadrotor.vectors import normalized

    assert all(math.isnan(x) for x in normalized((0.0, 0.0, 0.0, 0.0)))


def test_machine_code_of_records_works_on_a_field_and_refuses_a_record_of_another_size() -> None:
    rest = module.direct(rest_reference, new_state(), new_reference())
    tick = new_tick()
    tick["state"]["position_w"] = 1.0, 2.0, 3.0
    rest(tick["state"], tick["reference"])
    assert tick["reference"]["position_w"].tolist() == [[1.0, 2.0, 3.0]]
    with pytest.raises(TypeError, match="unbox"):
        rest(tick, tick["reference"])
