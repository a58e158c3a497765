"""The process of one plugin of a file or package: receives inputs, calls the plugin, answers.

It starts with the vehicle's real-time priority and gives it up before anything of the file runs.
"""

from __future__ import annotations

import json
import os
import resource
import socket
import sys
from collections.abc import Mapping
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np

from quadrotor.errors import QuadlabError, RefusedError, UsageError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.python_file import call_user_code, run_file
from vehicle.plugins.contract import Contract, as_attributes
from vehicle.plugins.formats import format_of

READY = b"ready"
"""First message of the process: the plugin is loaded."""
FAILED = b"!"
"""Begins the last message, the reason, which is longer than an answer."""
LARGEST, LONGEST = 2048, 1 << 16
"""Bytes of a reason, and of any message to the plugin."""
MEMORY = 1 << 30
"""Bytes of data that a plugin may hold."""
VALUES = b"="
"""Begins a message with values of the plugin's own parameters, in JSON; never as long as an
input."""


def serve(descriptor: int, contract: Contract, source: str) -> None:
    """Answer over this socket until it is closed. Args: `source` as `load` takes it.

    Raises UsageError for a file that holds no such plugin, RefusedError with file and line for
    whatever the plugin raises.
    """
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    connection = socket.socket(fileno=descriptor)
    try:
        _answer(connection, contract, source)
    except QuadlabError as error:  # told at once, before this process has ended
        reason = f"{error!s:{contract.outputs.itemsize + 1}}"
        connection.send(FAILED + reason.encode()[:LARGEST])
        raise


def _answer(connection: socket.socket, contract: Contract, source: str) -> None:
    plugin, file = load(contract, source), _file_of(contract, source)
    out = np.zeros(1, contract.outputs)
    for x in contract.rehearsal:
        call_user_code(file, partial(contract.step, plugin, as_attributes(x), out), UsageError)
    connection.send(READY)
    while data := connection.recv(LONGEST):
        if len(data) != contract.inputs.itemsize:
            call_user_code(file, partial(set_values, plugin, data), RefusedError)
            continue
        # Its own memory in each tick, which a plugin may keep and write.
        x = as_attributes(np.frombuffer(bytearray(data), contract.inputs))
        call_user_code(file, partial(contract.step, plugin, x, out), RefusedError)
        connection.send(out.tobytes())


def message_of(contract: Contract, values: Mapping[str, ParameterValue]) -> bytes:
    """Return the message that sets parameters of a plugin."""
    message = VALUES + json.dumps(values).encode()
    return message + b" " * (len(message) == contract.inputs.itemsize)


def set_values(plugin: Any, message: bytes) -> None:
    """Set parameters of a plugin, as `message_of` wrote them. Raises ParameterError."""
    ParameterStore(plugin.parameters).set(json.loads(message.removeprefix(VALUES)))


def load(contract: Contract, source: str | Path) -> Any:
    """Return a plugin.

    Args:
        source: the path of a Python file that defines a class or function that makes a plugin,
            named as the contract's kind, or of a file of another format
            (`vehicle.plugins.formats`); or the contract's group, `=`, and the value of an entry
            point that names such a class or function.

    Raises UsageError that names file and line.
    """
    path = Path(source)
    if (other := format_of(path)) is not None:
        return other.load(contract, path)
    if (point := _entry_point(contract, source)) is not None:
        made = call_user_code(path, point.load, UsageError)
        module = sys.modules[point.module]
    else:
        module = run_file(path, contract.kind, UsageError)
        made = vars(module).get(contract.kind)
    _check_protocol(contract, path.name, getattr(module, "PROTOCOL", 1))
    if not callable(made):
        raise UsageError(
            f"{path.name}: it defines no {contract.kind!r}; give a class or function of this name "
            "whose object has reset and step(x); docs/extending/plugins.md shows one"
        )
    plugin = call_user_code(path, made, UsageError)
    for method in ("reset", "step"):
        if not callable(getattr(plugin, method, None)):
            raise UsageError(f"{path.name}: {type(plugin).__name__} has no method {method}")
    return plugin


def _check_protocol(contract: Contract, name: str, stated: object) -> None:
    """Raise UsageError for a file of another version of the contract, with what to change."""
    spoken = contract.protocol
    if stated == spoken:
        return
    if not isinstance(stated, int) or isinstance(stated, bool) or stated < 1:
        remedy = f"write PROTOCOL = {spoken}"
    elif stated > spoken:
        remedy = "it was written for a later quadlab: update quadlab here"
    else:
        told = (contract.changes.get(older, "") for older in range(stated, spoken))
        remedy = f"{'; '.join(filter(None, told))}; then write PROTOCOL = {spoken}"
    raise UsageError(
        f"{name}: PROTOCOL = {stated!r}, and this vehicle speaks protocol {spoken} with a "
        f"{contract.kind}: {remedy}"
    )


def _entry_point(contract: Contract, source: str | Path) -> EntryPoint | None:
    group, _, value = str(source).partition("=")
    return EntryPoint("", value, group) if group == contract.group else None


def _file_of(contract: Contract, source: str) -> Path:
    """Return the file whose lines are told of, once the plugin is loaded."""
    point = _entry_point(contract, source)
    return Path((point and sys.modules[point.module].__file__) or source)
