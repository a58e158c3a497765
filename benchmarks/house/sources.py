"""The source files under version control, and what counts in each.

Code lines are lines that hold a token of code: no blank lines, comments or docstrings of modules,
classes and functions.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import tokenize
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath

from quadrotor.checkout import ROOT

EXTENSIONS = "extensions"
LONG_FUNCTION, MANY_POSITIONAL, WIDE = 50, 6, 120
"""Most code lines of a function, positional arguments of a call, and columns of JavaScript."""
FRAGMENT = re.compile(
    "(Of|Whether|As|Where|From|By|In|With|For|What|Who|How|When|If|That|To|At|On|Why|Which|It)\\b"
)
"""First words of a docstring that cannot stand alone in an IDE's hover."""
NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
_Functions = ast.FunctionDef | ast.AsyncFunctionDef
_Documented = _Functions | ast.ClassDef | ast.Module


def tracked(*patterns: str) -> list[PurePosixPath]:
    """Return the files under version control that match, relative to the root."""
    listed = subprocess.run(
        ["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [PurePosixPath(line) for line in listed.stdout.splitlines()]


@dataclass(frozen=True)
class Source:
    """One Python file.

    Attributes:
        path: relative to the root.
        text: its content.
    """

    path: PurePosixPath
    text: str

    @property
    def module(self) -> str:
        """Return the dotted name under which it is imported."""
        return ".".join(self.path.with_suffix("").parts).removesuffix(".__init__")

    @property
    def is_test(self) -> bool:
        return "tests" in self.path.parts[:-1]

    @property
    def extension(self) -> str:
        """Return the name of the extension that it belongs to, "" for core."""
        folder, *names = self.path.parts[:-1] or ("",)
        return names[0] if folder == EXTENSIONS and names else ""

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @cached_property
    def code(self) -> frozenset[int]:
        """Return the numbers of the lines with code."""
        lines: set[int] = set()
        for token in tokenize.generate_tokens(io.StringIO(self.text).readline):
            if token.type not in NO_CODE:
                lines |= set(range(token.start[0], token.end[0] + 1))
        for node in ast.walk(self.tree):
            match node:
                case ast.Module() | ast.ClassDef() | ast.FunctionDef() | ast.AsyncFunctionDef():
                    lines -= _docstring_lines(node)
        return frozenset(lines)

    @property
    def lines(self) -> int:
        """Return the number of code lines."""
        return len(self.code)

    @property
    def long_functions(self) -> list[tuple[int, str]]:
        """Return the code lines and the place of each function above LONG_FUNCTION lines."""
        functions = (node for node in ast.walk(self.tree) if isinstance(node, _Functions))
        sized = (
            (len(self.code & set(range(one.lineno, (one.end_lineno or 0) + 1))), one.name)
            for one in functions
        )
        return [(size, f"{self.path} {name}") for size, name in sized if size > LONG_FUNCTION]

    @property
    def positional_calls(self) -> int:
        """Return the number of calls with more than MANY_POSITIONAL positional arguments."""
        calls = (node for node in ast.walk(self.tree) if isinstance(node, ast.Call))
        return sum(len(call.args) > MANY_POSITIONAL for call in calls)

    @property
    def anys(self) -> int:
        """Return how often the name `Any` is used."""
        return sum(isinstance(n, ast.Name) and n.id == "Any" for n in ast.walk(self.tree))

    @property
    def fragments(self) -> int:
        """Return the number of docstrings that begin with neither a verb nor "The" nor "A"."""
        nodes = (node for node in ast.walk(self.tree) if isinstance(node, _Documented))
        return sum(bool(FRAGMENT.match(ast.get_docstring(node) or "")) for node in nodes)


def _docstring_lines(node: _Documented) -> set[int]:
    match node.body[:1]:
        case [ast.Expr(value=ast.Constant(value=str())) as first]:
            return set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return set()


def python_sources() -> list[Source]:
    """Return all Python files under version control."""
    return [Source(path, (ROOT / path).read_text(encoding="utf-8")) for path in tracked("*.py")]


def files_by_folder(paths: Iterable[PurePosixPath]) -> Counter[PurePosixPath]:
    """Return the number of files directly in each folder."""
    return Counter(path.parent for path in paths)


@dataclass(frozen=True)
class Scripts:
    """The page's JavaScript.

    Attributes:
        lines: neither blank nor a `//` comment.
        wide: above WIDE columns.
    """

    lines: int
    wide: int


def page_scripts() -> Scripts:
    """Return the size of the page's JavaScript, in core and in extensions."""
    lines = [
        line
        for path in tracked("*.js")
        if path.parts[0] in ("web", EXTENSIONS) and "tests" not in path.parts
        for line in (ROOT / path).read_text(encoding="utf-8").splitlines()
    ]
    code = sum(bool(line.strip()) and not line.strip().startswith("//") for line in lines)
    return Scripts(code, sum(len(line) > WIDE for line in lines))


def lines_by_package(sources: Iterable[Source]) -> Mapping[str, int]:
    """Return the code lines of each top-level folder."""
    counted: Counter[str] = Counter()
    for source in sources:
        counted[source.path.parts[0]] += source.lines
    return counted
