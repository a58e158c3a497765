"""What the documents tell people to type: commands are parsed, Python is compiled, what is quick
runs."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from quadlab.__main__ import main, parse
from quadrotor.checkout import ROOT

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
    "docs/reports.md",
    "docs/trajectories.md",
}
"""Documents whose Python needs a flight or a laboratory, or takes long; it is compiled alone."""


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
        for package in ("console", "quadlab", "vehicle", "vehicle_link", "web")
        for file in (ROOT / package).rglob("*.py")
    ]
    missing = [one for one in fragments if not any(one in source for source in sources)]
    assert missing == []
