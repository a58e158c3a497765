"""A user's own experiment: a Python file with one class of the Experiment protocol.

The file runs with all the rights of the process that loads it. Its mistakes are reported with file
and line. A flight is judged by the same source that flew it, also in another process.
"""

from __future__ import annotations

import ast
import copyreg
import hashlib
import inspect
import math
import pickle
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from console.experiments.client import Experiment
from quadrotor.errors import QuadlabError, UsageError
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.python_file import call_user_code, compile_source, line_of, read_source

METHODS = {
    "check": "def check(self) -> None",
    "fly": "def fly(self, client: Client) -> None",
    "evaluate": "def evaluate(self, log: Path) -> Result",
}
OPTIONAL = {
    "report": "def report(self, log: Path, folder: Path) -> list[Path]",
    "proposal": "def proposal(self, log: Path) -> CalibrationRecord",
    "preconditions": "def preconditions(self, view: VehicleView) -> str",
    "abort": "def abort(self, view: VehicleView) -> str",
}
ATTRIBUTES = ("name", "parameters", "planned")
GROUP = "quadlab.experiments"
"""Group of entry points by which installed packages offer modules with an experiment."""
NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")
WHERE = "docs/experiments.md shows one"


class UserFileError(QuadlabError):
    """An uncaught exception in a user's file, with its line."""


def is_file(name: str) -> bool:
    """Return whether this is a file name rather than the name of a built-in experiment."""
    return name.endswith(".py") or "/" in name or "\\" in name


def load(path: Path, vehicle: str = "quad1") -> Experiment:
    """Load the experiment of the file `path`.

    Raises StorageError for a file that cannot be read, UsageError with file and line for every
    mistake in it.
    """
    source = read_source(path)
    kind, node = _class_of(path, source)
    takes_vehicle = _accepts(kind, 1)
    experiment = call_user_code(
        path, lambda: kind(vehicle) if takes_vehicle else kind(), UsageError
    )
    _check(path, experiment, node)
    checked: Experiment = experiment
    return checked


@contextmanager
def errors_with_line(experiment: Experiment) -> Iterator[None]:
    """Wrap calls of a user's file: its exceptions become UserFileError, "FILE.py line N: …".

    Errors made for users pass unchanged, and so do all exceptions of a built-in experiment.
    """
    path = getattr(sys.modules.get(type(experiment).__module__), "experiment_file", None)
    try:
        yield
    except QuadlabError:
        raise
    except (Exception, SystemExit) as error:
        if path is None:
            raise
        raise UserFileError(line_of(path, error)) from error


def _class_of(path: Path, source: str) -> tuple[type, ast.ClassDef]:
    """Return the one class of the file that flies or evaluates, and its definition."""
    tree = call_user_code(path, lambda: ast.parse(source, str(path)), UsageError)
    module = _module(path, source)
    nodes = [
        node
        for node in tree.body
        if isinstance(node, ast.ClassDef) and _has_one(getattr(module, node.name, None), module)
    ]
    if not nodes:
        raise UsageError(
            f"{path.name} line 1: it has no experiment, which is a class with the methods "
            f"{', '.join(METHODS)}; {WHERE}"
        )
    if len(nodes) > 1:
        found = " and ".join(f"{node.name} (line {node.lineno})" for node in nodes)
        raise UsageError(f"{path.name}: it has several experiments, {found}; one file holds one")
    kind: type = getattr(module, nodes[0].name)
    return kind, nodes[0]


def _has_one(kind: object, module: ModuleType) -> bool:
    own = isinstance(kind, type) and kind.__module__ == module.__name__
    return own and (hasattr(kind, "fly") or hasattr(kind, "evaluate"))


def _module(path: Path, source: str) -> ModuleType:
    """Run the file once for each content, and register the module where pickle looks for it."""
    digest = hashlib.sha256(f"{path}\n{source}".encode()).hexdigest()[:12]
    name = f"experiment_file_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__ = str(path)
    vars(module).update(experiment_file=path, experiment_source=source)
    sys.modules[name] = module
    try:
        code = compile_source(path, source)
        call_user_code(path, lambda: exec(code, vars(module)), UsageError)
    except BaseException:
        del sys.modules[name]
        raise
    for kind in vars(module).values():
        if _has_one(kind, module):
            copyreg.pickle(kind, _reduced)
    return module


def _reduced(experiment: Any) -> tuple[Callable[..., object], tuple[object, ...]]:
    """Return the parts of a pickle that another process can load without this module."""
    kind = type(experiment)
    module: Any = sys.modules[kind.__module__]
    state = pickle.dumps(object.__reduce_ex__(experiment, 2)[2])
    return restored, (str(module.experiment_file), module.experiment_source, kind.__name__, state)


def restored(path: str, source: str, name: str, state: bytes) -> object:
    """Restore an experiment from the parts that `_reduced` returned."""
    kind = getattr(_module(Path(path), source), name)
    experiment = kind.__new__(kind)
    values = pickle.loads(state)
    for part in values if isinstance(values, tuple) else (values,):
        for key, value in (part or {}).items():
            object.__setattr__(experiment, key, value)
    return experiment


def _check(path: Path, experiment: Any, node: ast.ClassDef) -> None:
    """Check by its attributes and the signatures of its methods that this is an experiment."""
    lines = {one.name: one.lineno for one in node.body if isinstance(one, ast.FunctionDef)}

    def refuse(attribute: str, what: str) -> UsageError:
        line = lines.get(attribute, node.lineno)
        return UsageError(f"{path.name} line {line}: {node.name} {what}; {WHERE}")

    missing = call_user_code(
        path, lambda: [n for n in ATTRIBUTES if not hasattr(experiment, n)], UsageError
    )
    if missing:
        raise refuse(missing[0], f"has no {missing[0]!r}")
    for name, wanted in (METHODS | OPTIONAL).items():
        method = getattr(experiment, name, None)
        if method is None and name in OPTIONAL:
            continue
        if method is None:
            raise refuse(name, f"has no method {name}: add `{wanted}`")
        if not callable(method) or not _accepts(method, wanted.split(" ->")[0].count(":")):
            raise refuse(name, f"cannot be called as it will be: write `{wanted}`")
    if not isinstance(experiment.name, str) or not NAME.fullmatch(experiment.name):
        raise refuse("name", f"has the name {experiment.name!r}, allowed are a to z, 0 to 9 and _")
    options = experiment.parameters
    if options is not None and not isinstance(options, Parameters):
        raise refuse("parameters", "has `parameters` that are neither None nor Parameters")
    if options is not None:
        call_user_code(path, lambda: ParameterStore(options), UsageError)
    planned = call_user_code(path, lambda: experiment.planned, UsageError)
    number = isinstance(planned, int | float) and not isinstance(planned, bool)
    if not number or not (math.isfinite(planned) and planned >= 0.0):
        raise refuse(
            "planned", f"has planned = {planned!r}; set it to the seconds that the flight takes"
        )


def _accepts(method: Callable[..., object], count: int) -> bool:
    try:
        inspect.signature(method).bind(*range(count))
    except (TypeError, ValueError):
        return False
    return True
