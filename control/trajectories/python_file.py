"""A trajectory from a Python file that defines `trajectory`.

`trajectory` is an object of the `Trajectory` protocol, or a class or function that makes one when
called without arguments. It is run once, when it is loaded: what flies is the table made of it.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from control.trajectories.polynomial import Polynomial
from control.trajectories.tabulated import tabulate
from quadrotor.errors import RefusedError, StorageError

NAME = "trajectory"
T = TypeVar("T")


def load_python(path: Path) -> Polynomial:
    """Load the trajectory in the file `path`, which is run with all the rights of this process.

    Raises RefusedError that names the line, StorageError for a file that cannot be read.
    """
    try:
        source = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StorageError(f"{path} cannot be read as text: {error}") from None
    # A module of its own, where dataclasses and pickles look for it.
    module = ModuleType(f"trajectory_file_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    space = vars(module)
    try:
        code = compile(source, str(path), "exec")
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None) or 1
        raise RefusedError(f"{path.name}, line {line}: {_words(error)}") from None
    _run(path, lambda: exec(code, space))
    if NAME not in space:
        raise RefusedError(
            f"{path.name}: it defines no {NAME!r}; give a class, function or object of this name "
            "that offers duration (s) and sample(t, reference)"
        )
    made = space[NAME]
    # A class has `sample` too, but none to call yet.
    if isinstance(made, type) or not hasattr(made, "sample"):
        if not callable(made):
            raise RefusedError(
                f"{path.name}: {NAME} is {type(made).__name__}, which has no sample(t, reference)"
            )
        made = _run(path, made)
    for wanted in ("duration", "sample"):
        if not hasattr(made, wanted):
            raise RefusedError(
                f"{path.name}: what {NAME} makes ({type(made).__name__}) has no {wanted}; it needs "
                "duration (s) and sample(t, reference)"
            )
    return _run(path, lambda: tabulate(path.name, made))


def _run(path: Path, what: Callable[[], T]) -> T:
    """Return `what()`, with every mistake of the file turned into one line."""
    try:
        return what()
    except RefusedError:
        raise
    except (Exception, SystemExit) as error:
        lines = [
            frame.lineno
            for frame in traceback.extract_tb(error.__traceback__)
            if frame.filename == str(path)
        ]
        where = f", line {lines[-1]}" if lines else ""
        raise RefusedError(f"{path.name}{where}: {_words(error)}") from None


def _words(error: BaseException) -> str:
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {' '.join(text.split())}" if text else type(error).__name__
