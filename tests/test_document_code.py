"""Tests of all that documents tell people to type: commands are parsed, Python is compiled, what is
quick runs."""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import re
import shlex
import textwrap
from pathlib import Path

import pytest

from console.experiments.catalogue import find
from quadlab import laboratory
from quadlab.__main__ import main
from quadlab.commands.parsing import parse
from quadrotor.checkout import ROOT
from quadrotor.parameters import ParameterStore
from scripts.docs.reference import PAGES
from web.signals.expression import parse as parse_signal

DOCUMENTS = sorted(
    [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "examples/README.md"]
)
COMMAND = re.compile(r"^(?: {4,}(?:scripts/)?|scripts/)quadlab (.*)$", re.MULTILINE)
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
QUICK = ("gains", "new law mine --out plugins")
"""Commands that are run as well; others start processes, fly, or need a laboratory."""
SHOWN = {
    "docs/extending/notebooks.md",
    "docs/how_to/without_a_page.md",
    "docs/page/compare.md",
    "docs/reports.md",
    "docs/trajectories.md",
}
"""Documents whose Python needs a flight or a laboratory, or takes long; it is compiled alone."""

CHECKED = {"glossary.md", "how_to/troubleshooting.md", "page/charts.md", "parameters.md"}
"""Documents that are made of the code, or whose entries a test looks up in it."""


def commands(document: Path) -> list[str]:
    """Return the lines of quadlab in a document's blocks, without their comments."""
    text = document.read_text().replace("\\\n", " ")
    return [re.split(r"\s#\s", line)[0].strip() for line in COMMAND.findall(text)]


def python(document: Path) -> list[str]:
    return [code for kind, code in FENCE.findall(document.read_text()) if kind == "python"]


def name(document: Path) -> str:
    return document.relative_to(ROOT).as_posix()


def test_there_are_commands_and_python_to_look_at() -> None:
    assert sum(len(commands(one)) for one in DOCUMENTS) > 80
    assert sum(len(python(one)) for one in DOCUMENTS) > 4
    told = {line for one in DOCUMENTS for line in commands(one)}
    assert told.issuperset(QUICK)


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_the_command_line_takes_every_command_of_the_documents(document: Path) -> None:
    """Brackets mean that something may be left out: here nothing is."""
    for line in commands(document):
        with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
            parse(shlex.split(re.sub(r"[…\[\]]", "", line)))


@pytest.mark.parametrize("line", QUICK)
def test_quick_commands_do_what_the_documents_say(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(line.split()) == 0


@pytest.mark.parametrize("document", [one for one in DOCUMENTS if python(one)], ids=name)
def test_python_of_the_documents_runs(
    document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "beacons.csv").write_text(
        "id,x,y,z\n" + "".join(f"{k},{k % 2},{k // 2},0\n" for k in range(4))
    )
    monkeypatch.chdir(tmp_path)
    known: dict[str, object] = {}
    for code in python(document):
        compiled = compile(code, str(document), "exec")
        if name(document) not in SHOWN:
            exec(compiled, known)


def test_experiments_take_the_options_that_documents_give_them() -> None:
    texts = [code for document in DOCUMENTS for code in python(document)]
    texts.append(str(laboratory.__doc__).partition(":\n")[2])
    calls = [
        node
        for text in texts
        for node in ast.walk(ast.parse(textwrap.dedent(text)))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "lab.fly"
    ]
    assert len(calls) >= 2
    for call in calls:
        experiment = find(ast.literal_eval(call.args[0]))
        options = {str(one.arg): ast.literal_eval(one.value) for one in call.keywords}
        assert experiment.parameters is not None
        assert ParameterStore(experiment.parameters).set(options) == options


def test_every_message_of_the_troubleshooting_page_is_one_of_ours() -> None:
    text = (ROOT / "docs/how_to/troubleshooting.md").read_text()
    fragments = [
        quoted
        for row in re.findall(r"^\| (`.*?) \|", text, re.MULTILINE)
        for quoted in re.findall(r"`([^`]+)`", row)
    ]
    assert len(fragments) > 25
    sources = [
        re.sub(r'"\s*f?"', "", file.read_text())
        for package in ("console", "quadlab", "vehicle", "vehicle_link", "web", "extensions")
        for file in (ROOT / package).rglob("*.py")
    ]
    missing = [one for one in fragments if not any(one in source for source in sources)]
    assert missing == []


def navigation(*parts: str) -> list[str]:
    """Return the documents of these parts of the site."""
    part, found = "", []
    for line in (ROOT / "mkdocs.yml").read_text().partition("\nnav:\n")[2].splitlines():
        if heading := re.fullmatch(r"  - ([\w-]+):", line):
            part = heading[1]
        elif part in parts and (document := re.search(r": ([\w/]+\.md)$", line)):
            found.append(document[1])
    return found


def test_every_page_that_one_follows_or_looks_up_has_a_part_that_tests_run_or_make() -> None:
    pages = navigation("Tutorials", "How-to", "Reference")
    assert len(pages) > 40
    made = {f"reference/{name}.md" for name in PAGES} | CHECKED
    without = [
        page
        for page in pages
        if page not in made and not commands(ROOT / "docs" / page) + python(ROOT / "docs" / page)
    ]
    assert without == []


def test_everything_that_the_glossary_places_is_there() -> None:
    text = (ROOT / "docs/glossary.md").read_text()
    places = re.findall(r"`([\w./]+)`[^|]*\|$", text, re.MULTILINE)
    assert len(places) > 50
    missing = [place for place in places if not is_there(place)]
    assert missing == []


def is_there(place: str) -> bool:
    """Return whether this folder, module or name in a module exists."""
    if "/" in place:
        return (ROOT / place).is_dir()
    for end in range(place.count(".") + 1):
        module, *names = place.rsplit(".", end)
        with contextlib.suppress(ModuleNotFoundError):
            found: object = importlib.import_module(module)
            for one in names:
                found = getattr(found, one, None)
            return found is not None
    return False


def test_the_derived_signals_of_the_documents_are_understood() -> None:
    text = (ROOT / "docs/page/charts.md").read_text()
    [line] = re.findall(r"^ {4}(.+ = .+)$", text, re.MULTILINE)
    units = dict.fromkeys(re.findall(r"state\.velocity\.\w", line), "m/s")
    assert parse_signal(line, units).unit == "km/h"
