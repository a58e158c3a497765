"""The tick's functions are compiled once, reported, and found again."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from quadrotor.checkout import ROOT
from quadrotor.compiled import _default_root
from tests.support.narrowing import now
from vehicle.flight import kernels
from vehicle.flight.kernels import IN_SECOND_PROCESS, LATER, PARTS

PREPARE = """
from vehicle.flight.kernels import PARTS, prepare
from quadrotor.compiled import is_cached

print(*(part for part, (module, _) in PARTS.items() if not is_cached(module)))
refused, later = prepare(print)
print("refused", refused)
later.close()
later.wait()
"""


def prepare(cache: Path) -> tuple[set[str], list[str]]:
    """Return the parts that were not cached, and the messages."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", PREPARE],
        env=environment,
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
        timeout=150,
    )
    missing, *said = done.stdout.splitlines()
    return set(missing.split()), said


def test_what_is_not_kept_is_compiled_and_told_and_then_it_is_kept(tmp_path: Path) -> None:
    cache = tmp_path / "kernels"
    # All of this checkout's functions, except two: one is compiled by the second process.
    shutil.copytree(_default_root(), cache)
    for part in (IN_SECOND_PROCESS, "behaviors"):
        for folder in cache.glob(f"{PARTS[part][0]}-*"):
            shutil.rmtree(folder)
    missing, said = prepare(cache)
    assert missing >= {IN_SECOND_PROCESS, "behaviors"}
    assert said[0].startswith("compiling the flight laws, once")
    assert {f"{part} compiled" for part in missing} == set(said[1 : 1 + len(missing)])
    assert "refused []" in said
    missing, again = prepare(cache)
    assert missing == set()
    assert again[0] == "refused []"


class Beside:
    """Other process that compiles until it is marked as ended."""

    def __init__(self) -> None:
        self.ended = self.stopped = False

    def poll(self) -> bool:
        return self.ended

    def stop(self) -> None:
        self.stopped = True


def test_what_is_compiled_beside_is_loaded_once_it_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loaded: list[str] = []
    present, beside = {"a"}, Beside()
    asked: list[list[str]] = []
    parts = {name: (name, lambda name=name: loaded.append(name)) for name in "abc"}
    monkeypatch.setattr(kernels, "LATER", parts)
    monkeypatch.setattr(kernels, "is_cached", lambda module: module in present)

    def job(function: object, names: list[str], *rest: object, niceness: int) -> Beside:
        asked.append(names)
        return beside

    monkeypatch.setattr(kernels, "Job", job)
    later = kernels.BackgroundParts()
    assert asked == [["b", "c"]]
    assert later.load() == ["a"]
    present.add("b")  # half of the requested ones: not before it has ended
    assert not later.has_compiled
    assert later.load() == []
    beside.ended = True  # and failed at c
    assert now(later).has_compiled
    assert later.load() == ["b"]
    assert not later.has_compiled
    assert loaded == ["a", "b"]
    later.close()
    assert not beside.stopped


def test_compiling_beside_ends_with_the_flight_process(monkeypatch: pytest.MonkeyPatch) -> None:
    beside = Beside()
    monkeypatch.setattr(kernels, "is_cached", lambda module: False)
    monkeypatch.setattr(kernels, "Job", lambda *job, niceness: beside)
    kernels.BackgroundParts().close()
    assert beside.stopped


def test_every_part_names_a_module_that_has_compiled_functions() -> None:
    for module, _ in (PARTS | LATER).values():
        text = (ROOT / (module.replace(".", "/") + ".py")).read_text()
        assert "@compiled" in text
    assert IN_SECOND_PROCESS in PARTS
