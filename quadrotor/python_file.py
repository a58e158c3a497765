"""Users' Python files: run in this process, with every mistake reported as one line."""

from __future__ import annotations

import linecache
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import CodeType, ModuleType
from typing import TypeVar

from quadrotor.errors import QuadlabError, StorageError

T = TypeVar("T")


def read_source(path: Path) -> str:
    """Return the text of a file. Raises StorageError when it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not text in UTF-8"
        raise StorageError(f"{path} cannot be read: {why}") from None


def run_file(path: Path, prefix: str, mistake: type[QuadlabError]) -> ModuleType:
    """Run the file with all rights of this process, as a module named prefix_file_STEM.

    Raises StorageError when the file cannot be read, `mistake` with file and line for every error
    in it.
    """
    source = read_source(path)
    module = ModuleType(f"{prefix}_file_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where dataclasses and pickles look for it
    code = call_user_code(path, lambda: compile_source(path, source), mistake)
    call_user_code(path, lambda: exec(code, vars(module)), mistake)
    return module


def compile_source(path: Path, source: str) -> CodeType:
    """Return the code of a file with this source, and store the source for tracebacks and the
    docstrings of fields, as the file may change later. Raises SyntaxError.
    """
    linecache.cache[str(path)] = (len(source), None, source.splitlines(keepends=True), str(path))
    return compile(source, str(path), "exec")


def call_user_code(path: Path, what: Callable[[], T], mistake: type[QuadlabError]) -> T:
    """Return `what()`. Raises `mistake` with one line for any exception from the file; errors of
    this project pass unchanged.
    """
    try:
        return what()
    except QuadlabError:
        raise
    except (Exception, SystemExit) as error:
        raise mistake(line_of(path, error)) from None


def line_of(path: Path, error: BaseException) -> str:
    """Return "FILE.py line N: Kind: message", with the last line of the file in the traceback."""
    line = error.lineno if isinstance(error, SyntaxError) else None
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return f"{path.name} line {line or (lines[-1] if lines else 1)}: {words_of(error)}"


def words_of(error: BaseException) -> str:
    """Return kind and message of an exception as one line."""
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {' '.join(text.split())}" if text else type(error).__name__
