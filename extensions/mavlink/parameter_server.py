"""The parameter protocol: the vehicle's values, and its word on each change."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterator
from typing import Any

from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.operators import Operator
from extensions.mavlink.parameter_names import (
    HIGHEST,
    LOWEST,
    decoded,
    encoded,
    has_short_name,
    is_faithful,
    short_name,
)
from extensions.mavlink.peer import Peer
from quadrotor.errors import ParameterError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from vehicle_link.parameters.messages import from_parameters, from_value, to_parameters


class ParameterServer:
    """Answers PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET.

    Args:
        changes: queue of ParameterChange messages.
        say: tells a ground station a line, and prints it.

    Attributes:
        values: all values by their full names.
    """

    def __init__(self, changes: queue.SimpleQueue[Any], say: Callable[[Peer, str], None]) -> None:
        self._changes, self._say = changes, say
        self._known: dict[str, ParameterDescription] = {}  # by short name, in the vehicle's order
        self.values: dict[str, ParameterValue] = {}

    def load(self, descriptions: list[ParameterDescription], values: dict[str, Any]) -> list[str]:
        """Load the vehicle's parameters; return a line about each parameter that is left out."""
        known: dict[str, ParameterDescription] = {}
        left_out = []
        for one in filter(has_short_name, descriptions):
            if not is_faithful(one):
                why = f"allows integers beyond {LOWEST} to {HIGHEST}, which MAVLink cannot carry"
                left_out.append(
                    f"parameter {one.name} {why}; it is left out, change it on the page"
                )
            elif short_name(one.name) in known:
                left_out.append(
                    f"parameter {one.name} has no short name of its own and is left out"
                )
            else:
                known[short_name(one.name)] = one
        self._known, self.values = known, values
        return left_out

    @property
    def is_loaded(self) -> bool:
        return bool(self._known)

    def list_to(self, peer: Peer) -> None:
        """Send all values, as time allows."""
        peer.waiting["parameters"] = self._all()

    def _all(self) -> Iterator[MAVLink_message]:
        for name in list(self._known):
            if (message := self.message(name)) is not None:
                yield message

    def read(self, peer: Peer, message: MAVLink_message) -> None:
        """Send the value that is asked for by name or number."""
        name = _text(message.param_id)
        if message.param_index >= 0:
            name = next(iter(list(self._known)[message.param_index :]), "")
        if (answer := self.message(name)) is not None:
            peer.send(answer)
        else:
            index = message.param_index
            self._fail(peer, name, index, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)

    def set(self, peer: Peer, operator: Operator, message: MAVLink_message) -> None:
        """Ask the vehicle to change a value, and answer with the value that it then has."""
        name = _text(message.param_id)
        described = self._known.get(name)
        if described is None:
            self._fail(peer, name, -1, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)
            self._say(peer, f"parameter {name} is not there; docs/parameters.md has the names")
            return

        def answered(answer: Any, reason: str) -> None:
            if reason:
                self.refuse(peer, name, reason)
                return
            self.values.update(from_parameters(answer.applied))
            peer.send(self.message(name))

        try:
            value = decoded(described, message.param_value, message.param_type)
        except ParameterError as error:
            self.refuse(peer, name, str(error))
            return
        parameters = to_parameters({described.name: value})
        operator.ask(answered, "change_parameters", parameters=parameters)

    def refuse(self, peer: Peer, name: str, reason: str) -> None:
        """Refuse a change: the value that stays, the error, and the reason as text."""
        self._fail(peer, name, -1, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
        if (message := self.message(name)) is not None:
            peer.send(message)
        self._say(peer, reason)

    def changed(self) -> list[MAVLink_message]:
        """Return the messages of the changes since the last call, whoever made them."""
        out: list[MAVLink_message] = []
        while True:
            try:
                change = self._changes.get_nowait()
            except queue.Empty:
                return out
            if change.name in self.values:
                self.values[change.name] = from_value(change.new_value)
                if (message := self.message(short_name(change.name))) is not None:
                    out.append(message)

    def message(self, name: str) -> MAVLink_message:
        """Return PARAM_VALUE of a short name; None for one that is not there."""
        described = self._known.get(name)
        if described is None or described.name not in self.values:
            return None
        value, kind = encoded(described, self.values[described.name])
        names = list(self._known)
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(names), names.index(name)
        )

    def _fail(self, peer: Peer, name: str, index: int, error: int) -> None:
        peer.send(mavlink.MAVLink_param_error_message(peer.system, 0, name.encode(), index, error))


def _text(sent: Any) -> str:
    data = sent if isinstance(sent, bytes) else str(sent).encode("ascii", "replace")
    return data.split(b"\0")[0].decode("ascii", "replace")
