"""Tests that the documents and docstrings agree with the code."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

from benchmarks.house.sources import FRAGMENT

ROOT = Path(__file__).resolve().parent.parent
TEST = r"(?:extensions/\w+/)?tests/[\w/]+\.py"
ROW = re.compile(rf"^\|[^|]+\|[^|]*\| `([\w.]+)` \| `({TEST})` \|$", re.MULTILINE)


def rows() -> list[tuple[str, str]]:
    return ROW.findall((ROOT / "docs/paper_map.md").read_text())


def test_the_paper_map_has_a_row_for_every_numbered_equation() -> None:
    text = (ROOT / "docs/paper_map.md").read_text()
    assert len(rows()) >= 15
    for number in (1, 2, 3, 4, 5, 11, 12, 13):
        assert re.search(rf"\beq\. {number}\b", text), f"eq. {number} is not in the paper map"


def test_every_row_of_the_paper_map_names_a_function_and_its_test() -> None:
    wrong = []
    for function, test in rows():
        module, name = function.rsplit(".", 1)
        if not hasattr(importlib.import_module(module), name):
            wrong.append(f"{function} does not exist")
        source = (ROOT / test).read_text()
        if name not in source and module.rsplit(".", 1)[-1] not in source:
            wrong.append(f"{test} does not use {name}")
    assert wrong == []


def test_every_relative_link_of_a_document_leads_somewhere() -> None:
    wrong = []
    for document in (*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md"):
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", document.read_text()):
            if "://" not in target and not (document.parent / target).exists():
                wrong.append(f"{document.name} links to {target}")
    assert wrong == []


PATH = re.compile(r"`([\w.-]+/[\w./-]*)`")
"""A path in back ticks. Where it begins with a folder of the repository, it has to be there."""
MADE = {"firmware/build/image.hex", "extensions/NAME"}


def test_every_path_of_the_repository_in_a_document_is_there() -> None:
    folders = {path.name for path in ROOT.iterdir() if path.is_dir()}
    wrong = [
        f"{document.relative_to(ROOT)}: {path}"
        for document in (*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md")
        for path in PATH.findall(re.sub(r"(?m)^    .*$", "", document.read_text()))
        if path.partition("/")[0] in folders and not (ROOT / path).exists() and path not in MADE
    ]
    assert wrong == []


def test_the_parameters_page_is_what_the_models_say() -> None:
    # In a process of its own: flights of other tests in this one offer names of plugins.
    code = "from scripts.docs.parameters import page; print(page(), end='')"
    words = [sys.executable, "-c", code]
    page = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    text = (ROOT / "docs/parameters.md").read_text()
    assert text == page, "run scripts/parameters_page"


def test_the_faults_page_and_the_panels_table_are_what_the_declarations_say() -> None:
    from scripts.docs.faults import page, page_table

    said = "run scripts/faults_page"
    assert (ROOT / "docs/how_to/faults.md").read_text() == page(), said
    assert (ROOT / "web/static/faults/faults.json").read_text() == page_table(), said


def test_every_document_the_code_refers_to_is_there() -> None:
    folders = [
        p
        for p in ROOT.iterdir()
        if p.is_dir() and p.name[0].isalpha() and p.name not in ("build", "node_modules")
    ]
    files = [
        p for folder in folders for kind in ("py", "js", "html") for p in folder.rglob(f"*.{kind}")
    ]
    assert files
    for file in files:
        for document in re.findall(r"docs/[\w/-]+\.md", file.read_text()):
            assert (ROOT / document).exists(), f"{file.relative_to(ROOT)} refers to {document}"


def test_readme_changelog_and_examples_stay_short() -> None:
    assert len((ROOT / "README.md").read_text().split()) <= 500
    changes = (ROOT / "CHANGELOG.md").read_text().splitlines()
    assert len(changes) <= 120
    assert max(map(len, changes)) <= 600  # a change is a line or two, not a chapter
    lines = {
        file.relative_to(ROOT).as_posix(): len(file.read_text().splitlines())
        for kind in ("py", "m")
        for file in (ROOT / "examples").rglob(f"*.{kind}")
    }
    # A whole filter on poses, markers and bearings, beside a short one.
    assert lines.pop("examples/estimators/error_state_ekf.py") <= 85
    assert max(lines.values()) <= 60, lines
    listed = (ROOT / "examples/README.md").read_text()
    missing = [file for file in lines if f"({file.removeprefix('examples/')})" not in listed]
    assert missing == []


PRODUCT = [
    "quadrotor",
    "control",
    "estimation",
    "bearing_sim",
    "flight_log",
    "vehicle_link",
    "vehicle",
    "console",
    "web",
    "quadlab",
]


def test_docstrings_of_public_functions_are_sentences() -> None:
    """An IDE shows the docstring alone: it begins with a verb ("Return the …") or "The"."""
    found = []
    for file in sorted(file for package in PRODUCT for file in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name[0] != "_":
                docstring = ast.get_docstring(node) or ""
                if FRAGMENT.match(docstring):
                    place = f"{file.relative_to(ROOT)}:{node.lineno} {node.name}"
                    found.append(f"{place}: {docstring[:40]} …")
    assert not found, "\n".join(["begin these with a verb, such as Return:", *found])
