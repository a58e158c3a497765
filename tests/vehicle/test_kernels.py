"""The tick's compiled functions are made once, said to be, and found again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from vehicle.kernels import HELPED, LATER, PARTS

ROOT = Path(__file__).resolve().parents[2]
PREPARE = """
from vehicle.kernels import prepare

refused, later = prepare(print)
print("refused", refused)
if later is not None:
    later.terminate()
    print("later", later.wait())
"""


def prepare(cache: Path) -> list[str]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", PREPARE], env=environment, cwd=ROOT, check=True,
        capture_output=True, text=True, timeout=150,
    )  # fmt: skip
    return done.stdout.splitlines()


def test_what_is_not_kept_is_compiled_and_told_and_then_it_is_kept(tmp_path: Path) -> None:
    said = prepare(tmp_path)
    assert said[0].startswith("compiling the flight laws, once")
    assert {f"{part} compiled" for part in PARTS} == set(said[1 : 1 + len(PARTS)])
    assert "refused []" in said
    again = prepare(tmp_path)
    assert again[0] == "refused []"


def test_every_part_names_a_module_that_has_compiled_functions() -> None:
    for module, _ in (PARTS | LATER).values():
        text = (ROOT / (module.replace(".", "/") + ".py")).read_text()
        assert "@compiled" in text
    assert HELPED in PARTS
