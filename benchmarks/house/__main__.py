"""Print the size and shape of the source tree, and check them: `python -m benchmarks.house`."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Sequence
from pathlib import PurePosixPath

from benchmarks.house.budget import excesses, lowered, read_budget
from benchmarks.house.graph import BOOKS, book, import_graph, into_extensions, knots
from benchmarks.house.sources import (
    EXTENSIONS,
    LONG_FUNCTION,
    MANY_POSITIONAL,
    WIDE,
    Source,
    files_by_folder,
    lines_by_package,
    page_scripts,
    python_sources,
    tracked,
)
from quadrotor.checkout import ROOT
from quadrotor.errors import UsageError

LARGEST_FOLDER, LARGEST_MODULE = 25, 300


class House:
    """All figures of one state of the tree."""

    def __init__(self) -> None:
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
        packages = (*project["importlinter"]["root_packages"], EXTENSIONS)
        self.sources = python_sources()
        self.product = [
            one for one in self.sources if one.path.parts[0] in packages and not one.is_test
        ]
        self.tests = [one for one in self.sources if one.is_test]
        graph = import_graph(self.product)
        self.books = {name: book(graph, PurePosixPath(start)) for name, start in BOOKS.items()}
        self.knots = knots(graph)
        self.into_extensions = into_extensions(graph)
        self.scripts = page_scripts()
        self.long_functions = sorted(
            (found for one in self.product for found in one.long_functions), reverse=True
        )
        self.long_modules = [
            f"{one.path} {one.text.count(chr(10))}"
            for one in self.product
            if one.text.count("\n") > LARGEST_MODULE
        ]
        self.crowded = [
            f"{folder} {count}"
            for folder, count in files_by_folder(tracked()).most_common()
            if count > LARGEST_FOLDER and folder.name not in ("images", "msg")
        ]

    @property
    def figures(self) -> dict[str, int]:
        """Return the figures that have a budget."""
        core = [one for one in self.product if not one.extension]
        knotted = sum(len(loop) for loops in self.knots.values() for loop in loops)
        return {
            "core": _lines(core),
            "extensions": _lines([one for one in self.product if one.extension]),
            **{f"book of the {name}": _lines(list(read)) for name, read in self.books.items()},
            "knotted folders": knotted,
            "imports of extensions": len(self.into_extensions),
            "long functions": len(self.long_functions),
            "long modules": len(self.long_modules),
            "crowded folders": len(self.crowded),
            "positional calls": sum(one.positional_calls for one in self.product),
            "Any": sum(one.anys for one in self.product),
            "JavaScript": self.scripts.lines,
            "wide JavaScript": self.scripts.wide,
            "docstrings that are fragments": sum(one.fragments for one in self.sources),
        }

    def lines(self) -> list[str]:
        """Return all figures and where they come from, one a line."""
        sized = ((_lines([o for o in self.product if o.extension == e]), e) for e in self._names)
        return [
            *(f"{name:32} {value:>7,}" for name, value in self.figures.items()),
            "",
            f"Code lines of tests: {_lines(self.tests):,}; of the packages: "
            + ", ".join(f"{n} {lines:,}" for n, lines in lines_by_package(self.product).items()),
            "Extensions: " + (", ".join(f"{name} {size:,}" for size, name in sized) or "none"),
            "Modules of the books: " + ", ".join(f"{n} {len(b)}" for n, b in self.books.items()),
            *(f"Knot in {package}: {', '.join(loop)}" for package, loop in self._loops),
            *(f"Above {LONG_FUNCTION} lines: {n} {where}" for n, where in self.long_functions),
            *(f"Above {LARGEST_MODULE} lines: {where}" for where in self.long_modules),
            *(f"Above {LARGEST_FOLDER} files: {where}" for where in self.crowded),
            *self.into_extensions,
            f"Positional calls: more than {MANY_POSITIONAL} arguments; wide JavaScript: more than "
            f"{WIDE} columns.",
        ]

    @property
    def _names(self) -> list[str]:
        return sorted({one.extension for one in self.product} - {""})

    @property
    def _loops(self) -> list[tuple[str, list[str]]]:
        return [(package, loop) for package, found in self.knots.items() for loop in found]


def _lines(sources: Sequence[Source]) -> int:
    return sum(one.lines for one in sources)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.house", description=__doc__)
    parser.add_argument("--check", action="store_true", help="print what is above its budget alone")
    parser.add_argument("--lower", action="store_true", help="lower the budget to the figures")
    words = parser.parse_args()
    house = House()
    if words.lower:
        print(f"{lowered(house.figures)} limits lowered")
        return 0
    if not words.check:
        print("\n".join(house.lines()))
    try:
        found = excesses(house.figures, read_budget())
    except UsageError as error:
        found = [str(error)]
    print("".join(f"quadlab: {line}\n" for line in found), end="", file=sys.stderr)
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
