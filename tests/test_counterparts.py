"""A bare run says what it leaves out, a complete one what is missing or broken."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.bare import HIDDEN, link_programs
from tests.counterparts import COUNTERPARTS, left_out_line, problems

ROOT = Path(__file__).parents[1]


def program(folder: Path, name: str, body: str) -> None:
    """Write a shell script that stands for a program of others which is there but broken."""
    (folder / name).write_text(f"#!/bin/sh\n{body}\n")
    (folder / name).chmod(0o755)


@pytest.mark.parametrize(
    ("word", "name", "body", "said"),
    [
        ("chromium", "chromium-headless-shell", "exit 0", "does not show a page"),
        (
            "chromium",
            "chromium-headless-shell",
            "echo no libnss3 >&2; exit 127",
            "chromium-headless-shell does not work: status 127, no libnss3",
        ),
        ("node", "node", "echo v12.22.12", "node v12.22.12 is older than 20.19"),
        ("node", "node", "echo soon", "node says 'soon' when asked for its version"),
        ("gcc", "gcc", "echo 'no cc1' >&2; exit 1", "gcc does not work: status 1, no cc1"),
        ("octave", "octave-cli", "echo no package >&2; exit 1", "octave-cli does not work"),
    ],
)
def test_a_broken_counterpart_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, word: str, name: str, body: str, said: str
) -> None:
    program(tmp_path, name, body)
    link_programs(["/bin", "/usr/bin"], tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    [line], forbidden = problems([word])
    assert line.startswith(f"{COUNTERPARTS[word].title}: ")
    assert said in line
    assert line.endswith(f"on Debian: {COUNTERPARTS[word].install}")
    assert line.count("\n") == 0
    assert forbidden == {}


def test_a_bare_machine_has_all_programs_but_the_counterparts(tmp_path: Path) -> None:
    shown, linked = tmp_path / "shown", tmp_path / "linked"
    shown.mkdir()
    linked.mkdir()
    hidden = ("gcc", "gcc-12", "x86_64-linux-gnu-gcc", "chromium", "node", "npx", "octave-cli")
    for name in ("sh", "python3", "nodes", *hidden):
        program(shown, name, "")
    link_programs([str(shown), str(tmp_path / "absent")], linked)
    assert sorted(os.listdir(linked)) == ["nodes", "python3", "sh"]
    assert len(HIDDEN) > len(hidden)


def test_a_complete_run_on_a_bare_machine_names_each_missing_counterpart() -> None:
    words = [sys.executable, "-m", "tests.bare", sys.executable, "-m", "pytest", "--complete"]
    here = str(Path(__file__).relative_to(ROOT))
    ran = subprocess.run(
        [*words, "--collect-only", here], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.returncode == pytest.ExitCode.USAGE_ERROR
    lines = [line.removeprefix("ERROR: ") for line in ran.stderr.splitlines() if line]
    named = {line.partition(":")[0] for line in lines}
    assert named == {part.title for part in COUNTERPARTS.values() if not part.of_kernel}


def test_a_bare_run_says_what_it_leaves_out_and_what_installs_that() -> None:
    assert left_out_line(Counter(gcc=2, octave=1, betaflight=3)) == (
        "Left out, because they need more than Python: the C compilers (2 tests), Betaflight (3 "
        "tests), Octave (1 test). `apt install gcc g++ make libc6-dev octave octave-sockets` and "
        "`scripts/betaflight` install these; `scripts/test --complete` then runs the rest"
    )


def test_a_fresh_checkout_is_compiled_once_though_a_module_of_tests_was_imported(
    tmp_path: Path,
) -> None:
    told, python = tmp_path / "told", tmp_path / ".venv" / "bin"
    for folder in (tmp_path / "scripts", tmp_path / "tests" / "__pycache__", python):
        folder.mkdir(parents=True)
    shutil.copy(ROOT / "scripts" / "test", tmp_path / "scripts")
    program(tmp_path / "scripts", "setup", "exit 0")
    program(python, "python", f'echo "$*" | head -1 >> {told}')
    for _ in range(2):
        subprocess.run([tmp_path / "scripts" / "test"], check=True)
    ran = told.read_text()
    assert ran.count("--collect-only") == ran.count("import prepare") == 1
    assert ran.count("-m not alone") == ran.count("-m pytest -m alone") == 2
