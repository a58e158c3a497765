"""A page's modules joined to one script and its stylesheets to one: two requests, not a hundred.

The page's own files use only a few forms, so no compiler is needed: each module becomes a function
that is called once and returns what others import from it, in the order in which a browser would
run them. Any other form is refused with its file and line:

    import { a, b as c } from "../other.js";     import "./other.js";
    export const …       export function …       export async function …       export class …

A file can also be named from the root, as "/static/core/dom.js". Lines stay as they are, and a
source map leads a browser's tools back to the files.

A module that shows panels of an extension has a script of its own, so that an error in it stops
nothing else. The modules that it shares with the page's script are run once, by that script.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from web.source_map import source_map

Read = Callable[[str], str]
"""Function that returns the text of a file by its name. Raises FileNotFoundError."""

PANELS = "console/panels.js"
"""Module of the page to which a panel's script gives the function that shows it."""
_ROOT = "/static/"
_SHARED = "globalThis.$$shared"
_IMPORT = re.compile(
    rf'^import(?:\s*\{{([^{{}}]*)\}}\s*from)?\s*"((?:\.\.?/|{_ROOT})[\w./-]+\.js)";', re.M
)
_EXPORT = re.compile(r"^export (?=(?:const|(?:async )?function|class) )", re.MULTILINE)
_BINDING = re.compile(r"([A-Za-z_$][\w$]*)(?: as ([A-Za-z_$][\w$]*))?")
_OTHER = re.compile(r"^\s*(?:import|export)\b(?!\s*[:=(.]).*|\bimport\s*(?:\(|\.\s*meta\b)", re.M)
_AWAIT = re.compile(r"^(?:(?:export )?(?:const|let|var)\s[^=\n]*=\s*)?await\b", re.MULTILINE)


class JoinError(Exception):
    """Error of a module that cannot be joined, with its name, line and reason."""


@dataclass(frozen=True)
class Joined:
    """One script, and its source map as JSON."""

    text: str
    source_map: str


@dataclass(frozen=True)
class PanelScript:
    """The script of a panel: the panel's name, its module, and the function that shows it."""

    name: str
    module: str
    function: str


@dataclass(frozen=True)
class _Module:
    name: str
    code: str  # with as many lines as the file
    source: str
    needs: tuple[str, ...]  # in the order of its imports


def join_modules(
    entry: str, read: Read, map_address: str, place: str, panels: Iterable[PanelScript] = ()
) -> Joined:
    """Join the modules of a page into one script. Raises JoinError.

    Args:
        entry: name of the module that the page loads.
        map_address: address of the source map, relative to the script.
        place: address of the folder of the files, for the map.
        panels: the panels of the page, whose scripts use modules of this one.
    """
    modules = _in_order(entry, read)
    wanted = _wanted(modules, modules)
    shared = set()
    for panel in panels:
        for name, names in _of_panel(panel, read, modules)[1].items():
            if name in modules:
                wanted[name] |= names
                shared.add(name)
    given = ", ".join(f'"{name}": {_variable(name)}' for name in sorted(shared))
    before_entry = [f"{_SHARED} = {{ {given} }};"] if shared else []
    return _joined(modules, wanted, ([], before_entry, []), (map_address, place))


def join_panels(
    panels: Sequence[PanelScript], page: str, read: Read, map_address: str, place: str
) -> Joined:
    """Join the modules of the panels that one module shows, without those that it shares with the
    page. Raises JoinError.

    Args:
        page: name of the module that the page loads.
        map_address, place: as for `join_modules`.
    """
    known = _in_order(page, read)
    modules, wanted = _of_panel(panels[0], read, known)
    shared = sorted(name for name in wanted if name in known)
    head = [f'const {_variable(name)} = {_SHARED}["{name}"];' for name in shared]
    tail = [f'{_variable(PANELS)}.addPanel("{one.name}", {one.function});' for one in panels]
    return _joined(modules, wanted, (head, [], tail), (map_address, place))


def _of_panel(
    panel: PanelScript, read: Read, known: Mapping[str, _Module]
) -> tuple[dict[str, _Module], dict[str, set[str]]]:
    """Return the modules of a panel alone, and what it imports of these and of the page's."""
    modules = _in_order(panel.module, read, known)
    _check_export("the page", modules[panel.module], panel.function)
    wanted = _wanted(modules, {**known, **modules})
    if (page := list(known)[-1]) in wanted:
        raise JoinError(f"{panel.module} imports {page}, which the page runs itself")
    return modules, {**wanted, PANELS: wanted.get(PANELS, set()) | {"addPanel"}}


def _wanted(modules: Mapping[str, _Module], known: Mapping[str, _Module]) -> dict[str, set[str]]:
    """Return the names that modules import, by the modules of which they import them."""
    wanted: dict[str, set[str]] = {name: set() for name in modules}
    for module in modules.values():
        for other, names in _imports(module):
            for name in names:
                _check_export(module.name, known[other], name)
            wanted.setdefault(other, set()).update(names)
    return wanted


def _joined(
    modules: Mapping[str, _Module],
    wanted: Mapping[str, set[str]],
    more: tuple[Sequence[str], Sequence[str], Sequence[str]],
    addresses: tuple[str, str],
) -> Joined:
    """Return the script of modules, each after those that it imports.

    Args:
        wanted: names of each module that others import.
        more: lines at the beginning, before the last module, which is the entry, and at the end.
        addresses: of the source map, and of the folder of the files.
    """
    (head, before_entry, tail), (map_address, place) = more, addresses
    lines = list(head)
    places: list[tuple[int, int] | None] = [None] * len(head)  # (which file, which line) or none
    *_, entry = modules
    for number, module in enumerate(modules.values()):
        code = module.code.rstrip("\n").split("\n")
        own = [(number, line) for line in range(len(code))]
        if module.name == entry:  # unchanged, so that it may await
            lines += [*before_entry, f"// ---- {module.name}", *code]
            places += [None] * len(before_entry) + [None, *own]
            continue
        given = ", ".join(sorted(wanted[module.name]))
        lines += [f"// ---- {module.name}", f"const {_variable(module.name)} = (() => {{", *code]
        lines += [f"return {{ {given} }};", "})();"]
        places += [None, None, *own, None, None]
    lines += [*tail, f"//# sourceMappingURL={map_address}"]
    return Joined("\n".join(lines) + "\n", source_map(modules, places, place))


def join_styles(names: Iterable[str], read: Read) -> str:
    """Return the stylesheets joined in this order.

    Raises JoinError for content that would have another meaning at another address.
    """
    parts = []
    for name in names:
        text = read(name)
        if found := re.search(r"@(?:import|charset)\b|\burl\((?!\s*[\"']?(?:data:|/|#))", text):
            line = text.count("\n", 0, found.start()) + 1
            raise JoinError(f"{name}, line {line}: {found[0]} cannot be joined; name it otherwise")
        parts.append(f"/* ---- {name} */\n{text.rstrip()}\n")
    return "".join(parts)


def _in_order(
    entry: str, read: Read, known: Mapping[str, _Module] = MappingProxyType({})
) -> dict[str, _Module]:
    """Return the modules, each after those that it imports, as a browser runs them.

    Those that are known are left out.
    """
    done: dict[str, _Module] = {}
    path: list[str] = []

    def visit(name: str) -> None:
        if name in done or name in known:
            return
        if name in path:
            circle = " → ".join([*path[path.index(name) :], name])
            raise JoinError(f"{circle}: modules that import each other cannot be joined")
        path.append(name)
        try:
            module = _parsed(name, read(name))
        except FileNotFoundError:
            by = f", which {path[-2]} imports" if len(path) > 1 else ""
            raise JoinError(f"there is no module {name}{by}") from None
        if len(path) > 1 and (waits := _AWAIT.search(module.source)) is not None:
            line = module.source.count("\n", 0, waits.start()) + 1
            raise JoinError(f"{name}, line {line}: only {entry}, which the page loads, may await")
        for other in module.needs:
            visit(other)
        done[path.pop()] = module

    visit(entry)
    return done


def _parsed(name: str, source: str) -> _Module:
    def bound(found: re.Match[str]) -> str:
        kept = "\n" * found[0].count("\n")
        if found[1] is None:
            return kept
        names = ", ".join(
            f"{theirs}: {ours}" if ours else theirs for theirs, ours in _bindings(name, found[1])
        )
        return f"const {{ {names} }} = {_variable(_resolved(name, found[2]))};{kept}"

    code = _EXPORT.sub("", _IMPORT.sub(bound, source))
    if (other := _OTHER.search(code)) is not None:
        start = other.start() + len(other[0]) - len(other[0].lstrip())
        line = code.count("\n", 0, start) + 1
        raise JoinError(
            f"{name}, line {line}: {other[0].strip():.60} cannot be joined; write "
            'import { a } from "./b.js"; or export before const, function or class, '
            "at the beginning of a line"
        )
    needs = tuple(dict.fromkeys(_resolved(name, one[2]) for one in _IMPORT.finditer(source)))
    return _Module(name, code, source, needs)


def _imports(module: _Module) -> list[tuple[str, list[str]]]:
    """Return the modules that a module imports, each with the imported names."""
    return [
        (_resolved(module.name, one[2]), [theirs for theirs, _ in _bindings("", one[1] or "")])
        for one in _IMPORT.finditer(module.source)
    ]


def _resolved(importer: str, address: str) -> str:
    """Return the name of the module at an address that is relative to its importer."""
    if address.startswith(_ROOT):
        return posixpath.normpath(address.removeprefix(_ROOT))
    return posixpath.normpath(posixpath.join(posixpath.dirname(importer), address))


def _bindings(name: str, listed: str) -> list[tuple[str, str]]:
    """Return pairs of the exported and the local name; the latter is "" if they are the same."""
    pairs = []
    for one in filter(None, (part.strip() for part in listed.split(","))):
        found = _BINDING.fullmatch(one)
        if found is None or found[1] == "default":
            raise JoinError(f"{name}: import {{ {one} }} cannot be joined; import it by its name")
        pairs.append((found[1], found[2] or ""))
    return pairs


def _check_export(importer: str, module: _Module, name: str) -> None:
    """Check that the name is exported.

    Otherwise the joined page would run, but a browser that loads the single modules would fail.
    """
    declared = rf"(?:async )?function\*? {re.escape(name)}\b|class {re.escape(name)}\b"
    constant = rf"const (?:[^\n]*, )?{re.escape(name)} ="
    if not re.search(rf"^export (?:{declared}|{constant})", module.source, re.MULTILINE):
        raise JoinError(f"{importer} imports {name} of {module.name}, which does not export it")


def _variable(name: str) -> str:
    """Return the variable for a module; no name in the page's files begins like it."""
    return "$$" + name.removesuffix(".js").replace("/", "$").replace("-", "_")
