"""Parameters of a plugin's own: read from its file without running it, before a tree is made.

A file, or the module that an entry point names, declares them as an experiment does, by a class of
`quadrotor.parameters.Parameters` whose bounds and units are written as literals; a file of another
format declares them in its own way (`vehicle.plugins.formats`). The vehicle shows them as
`plugins.NAME.FIELD`, and the plugin's process sets them on the attribute `parameters` of the
plugin.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from quadrotor.errors import StorageError, UsageError
from quadrotor.packaged_files import packaged_files
from quadrotor.parameters import Parameters, ParameterStore, parameter, parameters_of
from quadrotor.python_file import call_user_code, read_source
from vehicle.plugins.contract import KINDS
from vehicle.plugins.formats import endings, format_of

TYPES = {"float": float, "int": int, "bool": bool, "str": str}
_offered = Parameters()


def offered() -> Parameters:
    """Return the parameters of all plugins that were offered, a component for each."""
    return _offered.model_copy(deep=True)


def offer(folder: Path | None) -> list[str]:
    """Make the parameters that the files of a folder, and packages, declare part of the trees made
    from now on.

    Returns a line for each file whose parameters cannot be read; it may still run without them.
    """
    global _offered  # noqa: PLW0603 - like the registry of estimators, one for each process
    found: dict[str, Any] = {}
    refused = []
    for name, path in _sources(folder):
        try:
            other = format_of(path)
            own = other.declared(path) if other is not None else declared(path)
        except (UsageError, StorageError) as error:
            refused.append(str(error))
            continue
        if own is not None and name.isidentifier():
            found.setdefault(name, (type(own), own))
    _offered = parameters_of(Parameters, "PluginParameters", found)()
    return refused


def _sources(folder: Path | None) -> Iterator[tuple[str, Path]]:
    """Yield the names and files of all plugins; a file of the folder before a package's."""
    if folder is not None and folder.is_dir():
        known = {ending for kind in KINDS for ending in endings(kind)}
        for path in sorted(folder.iterdir()):
            if path.suffix in known:
                yield path.stem, path
    for kind in KINDS:
        yield from packaged_files(f"quadlab.{kind}s").items()


def declared(path: Path) -> Parameters | None:
    """Return the parameters that a file declares, None when it has none. Raises UsageError."""
    source = read_source(path)
    if "Parameters" not in source:
        return None
    body = call_user_code(path, lambda: ast.parse(source, str(path)), UsageError).body
    for node in body:
        if isinstance(node, ast.ClassDef) and "Parameters" in map(ast.unparse, node.bases):
            return _model(path, node)
    return None


def _model(path: Path, node: ast.ClassDef) -> Parameters:
    fields: dict[str, Any] = {}
    line = node.lineno
    try:
        for one, after in pairwise([*node.body, ast.Pass()]):
            if not isinstance(one, ast.AnnAssign) or not isinstance(one.value, ast.Call):
                continue
            line = one.lineno
            keywords = {str(k.arg): ast.literal_eval(k.value) for k in one.value.keywords}
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                keywords.setdefault("description", str(after.value.value))
            default = parameter(*map(ast.literal_eval, one.value.args), **keywords)
            fields[ast.unparse(one.target)] = (TYPES[ast.unparse(one.annotation)], default)
        made = parameters_of(Parameters, node.name, fields)()
        ParameterStore(made)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise UsageError(
            f"{path.name} line {line}: parameters of a plugin are written as NAME: float = "
            f"parameter(0.5, unit='m', ge=0.0, le=1.0) with literals and a docstring ({error})"
        ) from None
    return made
