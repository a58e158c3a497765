"""Every benchmark still runs, in its shortest form, with a figure in every row."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.__main__ import FOLDERS, NAMES
from extensions.importers.tests.foreign_flight import (
    columns_of,
    make_flight,
    write_csv,
    write_mapping,
)
from quadrotor.checkout import ROOT

IN_REAL_TIME = {
    "campaign_kills",
    "fleet_pace",
    "foreign_page",
    "hostile_doors",
    "laboratory_faults",
    "emergencies",
    "late_ticks",
    "link",
    "live_page",
    "live_signals",
    "starved",
    "up_cost",
    "view_rate",
}
"""Benchmarks that fly whole laboratories in real time for up to a minute in their shortest form, or
start as many processes.

Run them by hand after a change of what they measure: `python -m benchmarks NAME --smoke`.
"""
LONGEST = 280.0
"""Half the bound, in s, of one run, which takes up to 100 s on an idle computer."""
NEEDS: dict[str, tuple[str, ...]] = {
    "board_flights": ("betaflight",),
    "firmware": ("gcc", "simavr"),
    "foreign_laws": ("gcc",),
    "link": ("namespaces",),
    "page_notice": ("chromium",),
    "parameter_page": ("chromium",),
    "replay": ("chromium",),
    "run_list": ("chromium",),
    "starved": ("chromium",),
    "sticks": ("chromium",),
    "view_rate": ("chromium",),
}
"""Programs that a benchmark needs beside quadlab to measure everything; others need none."""


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "benchmarks", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=2 * LONGEST,
        check=False,
    )


def tables(printed: str) -> list[list[list[str]]]:
    """Return the cells of each row of each report's table of methods."""
    found = re.findall(r"^\| method \|.*\n\|---.*\n((?:\|.*\n)*)", printed, re.MULTILINE)
    return [[line.strip("|").split("|") for line in rows.splitlines()] for rows in found]


def groups() -> Iterator[object]:
    """Yield parameters of benchmarks that run in one process, which shares imports and kernels.

    They are of one folder and have the same needs; those without are part of the complete run too.
    """
    together: dict[tuple[str, ...], list[str]] = {}
    for folder, names in FOLDERS.items():
        for name in names:
            if name not in IN_REAL_TIME and name != "real_flights":
                together.setdefault((folder, *NEEDS.get(name, ("gcc",))), []).append(name)
    for (_, *needs), alike in together.items():
        yield pytest.param(alike, marks=pytest.mark.needs(*needs), id=" ".join(alike))


@pytest.mark.timeout(2 * LONGEST + 15.0)
@pytest.mark.parametrize("names", list(groups()))
def test_benchmarks_in_their_shortest_form_have_figures_in_every_row(names: list[str]) -> None:
    have_figures(names, run(*names, "--smoke"))


@pytest.mark.timeout(LONGEST + 15.0)
@pytest.mark.needs("gcc")
def test_the_benchmark_of_recorded_flights_has_figures_of_those_given(tmp_path: Path) -> None:
    write_csv(tmp_path / "flight.csv", columns_of(make_flight(seconds=10.0)))
    write_mapping(tmp_path / "flight.csv.toml")
    have_figures(["real_flights"], run("real_flights", "--smoke", "--data", str(tmp_path)))


def have_figures(names: list[str], done: subprocess.CompletedProcess[str]) -> None:
    """Check that each of these benchmarks has reported, with a figure in every row."""
    assert done.returncode == 0, done.stderr[-3000:]
    assert "Traceback" not in done.stderr, done.stderr[-3000:]
    begun = re.split(r"^(\w+) …$", done.stderr, flags=re.MULTILINE)[1:]
    assert begun[::2] == names
    for name, told in zip(names, begun[1::2], strict=True):
        assert re.search(r"^\w+: \d+ s$", told, re.MULTILINE), f"{name} has no report: {told}"
    found = tables(done.stdout)
    assert len(found) >= len(names), done.stdout
    for rows in found:
        assert rows, done.stdout
        for method, *cells in rows:
            figures = " ".join(cells)
            assert re.search(r"\d", figures), f"{method}: no figure in {cells}"
            assert not re.search(r"\b(nan|inf)\b", figures), f"{method}: {cells}"


def test_every_module_that_can_be_run_is_listed() -> None:
    listed = {module.replace(".", "/") + ".py" for module in NAMES.values()}
    runnable = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "benchmarks").rglob("*.py")
        if re.search(r"^def run\(size: Size", path.read_text(), re.MULTILINE)
    }
    assert runnable == listed


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--out", "DIR"), "--smoke writes nothing"),
        (("--quick",), "not allowed with argument --smoke"),
    ],
)
def test_a_smoke_run_has_neither_a_folder_nor_another_size(
    words: tuple[str, ...], told: str, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = run("pose", "--smoke", *(str(out) if word == "DIR" else word for word in words))
    assert done.returncode == 2
    assert told in done.stderr.splitlines()[-1]
    assert not done.stdout
    assert not out.exists()
