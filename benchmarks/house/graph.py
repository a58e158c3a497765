"""The graph of imports: the book of a process, loops of folders, imports of extensions.

An import counts wherever it stands, also inside a function, and so does the target of an offer.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath

from benchmarks.house.sources import Source

BOOKS = {
    "tick": "vehicle/flight/stack.py",
    "flight": "vehicle/flight/process.py",
    "comms": "vehicle/comms/process.py",
    "station": "console/station.py",
    "web": "web/process.py",
    "simulator": "vehicle/simulator/process.py",
}
"""The processes, and the module at which each begins."""

Graph = Mapping[Source, set[Source]]


def import_graph(sources: Sequence[Source]) -> Graph:
    """Return which of these files each of them imports."""
    by_name = {source.module: source for source in sources}
    return {
        source: {
            by_name[name]
            for name in (*_imported(source.tree, by_name), *_offered(source))
            if name in by_name
        }
        - {source}
        for source in sources
    }


def _imported(tree: ast.Module, known: Mapping[str, Source]) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                if inner in known:
                    yield inner
                elif node.module in known:
                    yield node.module


def _offered(source: Source) -> Iterator[str]:
    """Yield the modules of the package that offers of this file name by `target=".module:name"`."""
    package = source.module.rpartition(".")[0]
    for node in ast.walk(source.tree):
        if isinstance(node, ast.keyword) and node.arg == "target":
            text = node.value.value if isinstance(node.value, ast.Constant) else None
            if isinstance(text, str) and text.startswith("."):
                yield package + text.partition(":")[0]


def book(graph: Graph, start: PurePosixPath) -> set[Source]:
    """Return what has to be read to know the process that begins in a file."""
    todo = [source for source in graph if source.path == start]
    found: set[Source] = set()
    while todo:
        source = todo.pop()
        if source not in found:
            found.add(source)
            todo += graph[source]
    return found


def knots(graph: Graph) -> dict[str, list[list[str]]]:
    """Return the folders and modules of each package that import each other in loops."""
    between: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for source, imported in graph.items():
        package, *_ = source.path.parts
        for other in imported:
            if other.path.parts[0] == package and _room(other) != _room(source):
                between[package][_room(source)].add(_room(other))
    found = {package: loops(rooms) for package, rooms in sorted(between.items())}
    return {package: there for package, there in found.items() if there}


def _room(source: Source) -> str:
    return "/".join(source.path.parts[:2])


def loops(edges: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Return the nodes that reach each other, sorted, each set as a list of more than one."""
    reached = {node: _reach(edges, node) for node in edges}
    rest, found = set(edges), []
    for node in sorted(edges):
        if node in rest:
            loop = {node} | {other for other in reached[node] if node in reached.get(other, ())}
            rest -= loop
            if len(loop) > 1:
                found.append(sorted(loop))
    return found


def _reach(edges: Mapping[str, Iterable[str]], node: str) -> set[str]:
    todo, found = list(edges[node]), set[str]()
    while todo:
        other = todo.pop()
        if other not in found:
            found.add(other)
            todo += edges.get(other, ())
    return found


def into_extensions(graph: Graph) -> list[str]:
    """Return each import of an extension by core, and by another extension."""
    return sorted(
        f"{source.path} imports {other.path}"
        for source, imported in graph.items()
        for other in imported
        if other.extension and other.extension != source.extension
    )
