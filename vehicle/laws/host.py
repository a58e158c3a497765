"""The process of one law from a file or package: receives inputs, calls the law, answers.

It starts with the vehicle's real-time priority and gives it up before anything of the file runs.
"""

from __future__ import annotations

import os
import resource
import socket
import sys
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np

from quadrotor.errors import QuadlabError, RefusedError, UsageError
from quadrotor.python_file import call_user_code, run_file
from quadrotor.records import Record
from vehicle.laws.contract import INPUT_TYPE, OUTPUT_TYPE, Input, Law, as_input

READY = b"ready"
"""First message of the process: the law is loaded."""
FAILED = b"!"
"""Begins the last message, the reason, which is longer than an answer."""
LARGEST = 2048
MEMORY = 1 << 30
"""Bytes of data that a law may hold."""
NAME, FMU = "law", ".fmu"
GROUP = "quadlab.laws"
"""Group of the entry points by which installed packages offer laws."""


def serve(descriptor: int, source: str) -> None:
    """Answer over this socket until it is closed. Args: `source` as `load` takes it.

    Raises UsageError for a file that holds no law, RefusedError with file and line for whatever
    the law raises.
    """
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    connection = socket.socket(fileno=descriptor)
    try:
        _answer(connection, source)
    except QuadlabError as error:  # told at once, before this process has ended
        connection.send(FAILED + f"{error!s:41}".encode()[:LARGEST])
        raise


def _answer(connection: socket.socket, source: str) -> None:
    law, file = load(source), _file_of(source)
    connection.send(READY)
    out = np.zeros(1, OUTPUT_TYPE)
    while data := connection.recv(INPUT_TYPE.itemsize + 1):
        x = as_input(np.frombuffer(data, INPUT_TYPE))
        if x.reset:
            call_user_code(file, law.reset, RefusedError)
        call_user_code(file, partial(_step, law, x, out), RefusedError)
        connection.send(out.tobytes())


def _step(law: Law, x: Input, out: Record) -> None:
    """Write the law's answer to x into OUTPUT_TYPE (1,)."""
    thrust, torque_b = law.step(x)
    out["time"], out["thrust"], out["torque_b"] = x.time, thrust, torque_b


def load(source: str | Path) -> Law:
    """Return a law.

    Args:
        source: the path of an FMU, or of a Python file that defines a class or function `law`
            that makes one; or GROUP, `=`, and the value of an entry point that names one.

    Raises UsageError that names file and line.
    """
    path = Path(source)
    if path.suffix == FMU:
        from vehicle.laws.fmu import FmuLaw

        return FmuLaw(path)
    if (point := _entry_point(source)) is not None:
        made = call_user_code(path, point.load, UsageError)
    else:
        made = vars(run_file(path, NAME, UsageError)).get(NAME)
    if not callable(made):
        raise UsageError(
            f"{path.name}: it defines no {NAME!r}; give a class or function of this name whose "
            "object has reset() and step(x); docs/extending/plugins.md shows one"
        )
    law = call_user_code(path, made, UsageError)
    for method in ("reset", "step"):
        if not callable(getattr(law, method, None)):
            raise UsageError(f"{path.name}: {type(law).__name__} has no method {method}")
    found: Law = law
    return found


def _entry_point(source: str | Path) -> EntryPoint | None:
    group, _, value = str(source).partition("=")
    return EntryPoint("", value, group) if group == GROUP else None


def _file_of(source: str) -> Path:
    """Return the file whose lines are told of, once the law is loaded."""
    point = _entry_point(source)
    return Path((point and sys.modules[point.module].__file__) or source)
