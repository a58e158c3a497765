"""Extensions of installed packages: what they offer is there; a broken one disturbs no other."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from quadrotor import extensions
from quadrotor.errors import UsageError
from quadrotor.extension import Command, Extension, Group, PageDocument, PagePanel
from quadrotor.extensions import FOLDER, GROUP, Registry, registry
from tests.support.installed import install

GOOD = """
from quadrotor.extension import Command, Extension, Group
EXTENSION = Extension(
    name="wind_tunnel",
    summary="The wind tunnel of the laboratory",
    protocol=1,
    offers=(
        Command(
            name="tunnel",
            group=Group.SET_UP,
            summary="Set the wind.",
            target=".command:Tunnel",
            examples={"quadlab tunnel --speed 3": "blow"},
        ),
    ),
    libraries={"no_such_library": "pip install no_such_library"},
)
"""
COMMAND = '''
from dataclasses import dataclass

@dataclass
class Tunnel:
    """Set the wind."""

    speed: float = 0.0
    """m/s"""

    def run(self) -> int:
        print(f"wind {self.speed} m/s")
        return 0
'''
TAKEN, HOLDER = next(
    (name, offered.extension.name)
    for name, offered in registry().offers(Command).items()
    if " " not in name and offered.extension is not None
)
"""A command of an extension of quadlab itself, and that extension."""
ENTRY = {GROUP: "wind_tunnel = tunnels.extension:EXTENSION"}
FILES = {"tunnels/__init__.py": "", "tunnels/extension.py": GOOD, "tunnels/command.py": COMMAND}


@pytest.fixture(autouse=True)
def _read_anew() -> Iterator[None]:
    registry.cache_clear()
    yield
    registry.cache_clear()
    for name in [name for name in sys.modules if name.split(".")[0] == "tunnels"]:
        del sys.modules[name]


def declared(name: str = "one", **changed: Any) -> Extension:
    given = {"summary": "", "protocol": 1, "offers": (), **changed}
    return Extension(name=name, **given)


def command(name: str = "tunnel", target: str = ".command:Tunnel") -> Command:
    return Command(name=name, target=target, group=Group.FLY, summary="")


def read(*found: object) -> Registry:
    return Registry(
        (f"{k} of some-things", "tunnels", partial(itself, one)) for k, one in enumerate(found)
    )


def itself(one: object) -> object:
    return one


def program(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder), *words],
        capture_output=True,
        text=True,
        check=False,
    )


PROGRAM = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from quadlab.__main__ import main
sys.exit(main())
"""


def test_a_packages_command_is_in_the_overview_and_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, tmp_path, ENTRY, FILES)
    listed = program(tmp_path)
    assert "  tunnel      Set the wind.\n" in listed.stdout
    assert listed.stderr == ""
    done = program(tmp_path, "tunnel", "--speed", "3")
    assert (done.returncode, done.stdout, done.stderr) == (0, "wind 3.0 m/s\n", "")


@pytest.mark.parametrize(
    ("declaration", "why"),
    [
        ("raise RuntimeError('no wind')", "is left out: RuntimeError: no wind"),
        ("EXTENSION = 3", "its declaration is of type int; write EXTENSION = Extension("),
        ("", "is left out: AttributeError: module 'tunnels.extension' has no"),
        (
            GOOD.replace("protocol=1", "protocol=0"),
            "it is written for protocol 0, quadlab has 1; update the extension",
        ),
        (
            GOOD.replace('name="tunnel"', 'name="up"'),
            "its command up is left out, because quadlab itself has one of this name; rename it",
        ),
        (
            GOOD.replace('name="tunnel"', f'name="{TAKEN}"'),
            f"its command {TAKEN} is left out, because the extension {HOLDER} has one of this name",
        ),
        (GOOD.replace("group=Group.SET_UP,", ""), "the command 'tunnel' needs a group"),
    ],
)
def test_a_broken_extension_is_named_in_one_line_and_all_else_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, declaration: str, why: str
) -> None:
    install(monkeypatch, tmp_path, ENTRY, {**FILES, "tunnels/extension.py": declaration})
    done = program(tmp_path, "gains")
    assert done.returncode == 0
    assert "stiff" in done.stdout
    (line,) = done.stderr.splitlines()
    assert line.startswith("quadlab: extension wind_tunnel")
    assert why in line


def test_a_command_whose_library_is_missing_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacking = f"import no_such_library\n{COMMAND}"
    install(monkeypatch, tmp_path, ENTRY, {**FILES, "tunnels/command.py": lacking})
    done = program(tmp_path, "tunnel")
    assert done.returncode == 2
    assert done.stderr == (
        "quadlab: extension wind_tunnel: command tunnel needs the package no_such_library; "
        "install it with pip install no_such_library\n"
    )
    assert program(tmp_path, "gains").returncode == 0


def test_of_two_offers_with_one_name_the_first_is_taken() -> None:
    found = read(declared("one", offers=(command(),)), declared("two", offers=(command(),)))
    (only,) = found.offers(Command).values()
    assert only.extension is not None
    assert only.extension.name == "one"
    assert list(found.problems) == [
        "extension two: its command tunnel is left out, because the extension one has one of this "
        "name; rename it"
    ]


def test_two_extensions_of_one_name_are_told() -> None:
    found = read(declared("one"), declared("one"))
    assert [one.name for one in found.extensions] == ["one"]
    assert list(found.problems) == [
        "extension 1 of some-things is left out: another extension has this name; rename one of "
        "them"
    ]


def test_an_extension_without_what_it_needs_is_left_out() -> None:
    found = read(declared("one", needs=("two",)), declared("three", needs=("one",)))
    assert found.extensions == []
    assert list(found.problems) == [
        "extension one is left out: it needs the extension two, which is not installed; install "
        "it, or remove this one",
        "extension three is left out: it needs the extension one, which is not installed; install "
        "it, or remove this one",
    ]


def test_a_target_without_a_name_is_refused() -> None:
    found = read(declared(offers=(command(target="tunnels.command"),)))
    assert "the target of its command tunnel is 'tunnels.command'" in next(iter(found.problems))


def test_code_of_an_extension_that_cannot_be_imported_names_it(tmp_path: Path) -> None:
    (only,) = read(declared(offers=(command(target=".nowhere:Tunnel"),))).offers(Command).values()
    with pytest.raises(UsageError, match="extension one: command tunnel cannot be imported: Mod"):
        only.load()


def test_every_built_in_extension_loads_all_that_it_offers() -> None:
    found = registry()
    assert found.problems == {}
    names = {one.name for one in found.extensions}
    assert names == {n for n in extensions.BUILT_IN if find_spec(f"{FOLDER}.{n}")}
    for kind in {type(offer) for one in found.extensions for offer in one.offers}:
        for offered in found.offers(kind).values():
            if kind in (PagePanel, PageDocument):  # files of the page; web.static_files reads them
                assert offered.offer.target.startswith("page/")
            else:
                assert offered.load() is not None, offered.offer
