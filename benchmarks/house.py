"""Count the size and tidiness of the source tree: `python -m benchmarks.house`.

Code lines are lines that hold a token of code: no blank lines, comments or docstrings.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from quadrotor.checkout import ROOT

LARGEST_FOLDER = 25
LARGEST_MODULE = 300
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


def tracked(*patterns: str) -> list[Path]:
    """Return the files under version control that match, relative to the root."""
    listed = subprocess.run(
        ["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [Path(line) for line in listed.stdout.splitlines()]


def code_lines(source: str) -> int:
    """Return the number of lines of Python with code on them."""
    docstrings: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                docstrings |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in NO_CODE:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return len(lines - docstrings)


def fragments(source: str) -> int:
    """Return the number of docstrings that begin with neither a verb nor "The" nor "A"."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Module
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds))
    return sum(bool(FRAGMENT.match(ast.get_docstring(node) or "")) for node in nodes)


def script_lines(source: str) -> int:
    """Return the number of lines of JavaScript that are neither blank nor a `//` comment."""
    lines = (line.strip() for line in source.splitlines())
    return sum(bool(line) and not line.startswith("//") for line in lines)


def python_by_package() -> Counter[str]:
    """Return the code lines of each top-level folder that holds Python."""
    counted: Counter[str] = Counter()
    for path in tracked("*.py"):
        counted[path.parts[0]] += code_lines((ROOT / path).read_text(encoding="utf-8"))
    return counted


def files_by_folder(paths: Iterable[Path]) -> Counter[Path]:
    """Return the number of files directly in each folder."""
    return Counter(path.parent for path in paths)


def figures() -> list[tuple[str, str]]:
    """Return name and value of each figure."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    packages = project["importlinter"]["root_packages"]
    counted = python_by_package()
    sources = {path: (ROOT / path).read_text(encoding="utf-8") for path in tracked("*.py")}
    product = {p: s for p, s in sources.items() if p.parts[0] in packages}
    scripts = tracked("web/static/*.js")
    crowded = [
        f"{folder} {count}"
        for folder, count in files_by_folder(tracked()).most_common()
        if count > LARGEST_FOLDER
    ]
    long = [str(p) for p, s in product.items() if s.count("\n") > LARGEST_MODULE]
    checked = project["mypy"].get("packages", project["mypy"].get("files", []))
    return [
        ("product Python, code lines", str(sum(counted[name] for name in packages))),
        *((f"  {name}", str(counted[name])) for name in packages),
        ("product modules", str(len(product))),
        ("tests, code lines", str(counted["tests"])),
        ("benchmarks, code lines", str(counted["benchmarks"])),
        ("JavaScript, code lines", str(sum(script_lines((ROOT / p).read_text()) for p in scripts))),
        (f"folders with more than {LARGEST_FOLDER} files", ", ".join(crowded) or "0"),
        (f"modules above {LARGEST_MODULE} lines", f"{len(long)}: {', '.join(long)}"),
        ("packages that mypy checks strictly", f"{len(checked)}: {', '.join(checked)}"),
        ("docstrings that are fragments", str(sum(map(fragments, sources.values())))),
        ("fmt: skip", str(sum(s.count("# fmt:" + " skip") for s in sources.values()))),
        ("type: ignore", str(sum(s.count("# type:" + " ignore") for s in sources.values()))),
        ("Thread(", str(sum(s.count("threading.Thread(") for s in product.values()))),
    ]


def main() -> None:
    """Print all figures, one per line."""
    for name, value in figures():
        print(f"{name:42} {value}")


if __name__ == "__main__":
    main()
