"""Foxglove's websocket protocol, in the versions `foxglove.sdk.v1` and `foxglove.websocket.v1`.

Both are the same on the wire (https://github.com/foxglove/ws-protocol). Text messages are JSON with
their operation in `op`; binary messages begin with one byte that names it.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import msgspec

from quadrotor.parameter_description import ParameterValue

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
ENCODING = "cdr"
INFO, WARNING, ERROR = range(3)
"""Levels of a status message."""

_MESSAGE = struct.Struct("<BIQ")  # 1, subscription, ns of reception; then the payload
_CALL = struct.Struct("<BIII")  # 2 (its answer: 3), service, call, length of the encoding's name
_encode = msgspec.json.Encoder().encode


class Wanted(msgspec.Struct):
    id: int
    channelId: int  # noqa: N815 - the protocol's name


class Subscribe(msgspec.Struct, tag_field="op", tag="subscribe"):
    subscriptions: list[Wanted]


class Unsubscribe(msgspec.Struct, tag_field="op", tag="unsubscribe"):
    subscriptionIds: list[int]  # noqa: N815


class GetParameters(msgspec.Struct, tag_field="op", tag="getParameters"):
    parameterNames: list[str]  # noqa: N815
    id: str | None = None


class NewValue(msgspec.Struct):
    name: str
    value: bool | int | float | str


class SetParameters(msgspec.Struct, tag_field="op", tag="setParameters"):
    parameters: list[NewValue]
    id: str | None = None


class FollowParameters(msgspec.Struct, tag_field="op", tag="subscribeParameterUpdates"):
    parameterNames: list[str]  # noqa: N815


class LeaveParameters(msgspec.Struct, tag_field="op", tag="unsubscribeParameterUpdates"):
    parameterNames: list[str]  # noqa: N815


Asked = Subscribe | Unsubscribe | GetParameters | SetParameters | FollowParameters | LeaveParameters
_decoder: msgspec.json.Decoder[Asked] = msgspec.json.Decoder(Asked)


class Call(NamedTuple):
    """Call of a service."""

    service: int
    id: int
    payload: bytes


def parse_text(text: str) -> Asked:
    """Parse a request. Raises ValueError."""
    try:
        return _decoder.decode(text)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(
            f"{text!r:.60} is not a supported request ({error}); the specification is "
            "foxglove/ws-protocol, and clients neither publish nor fetch assets"
        ) from error


def parse_call(data: bytes) -> Call:
    """Parse the binary call of a service. Raises ValueError."""
    if len(data) < _CALL.size or data[0] != 2:
        raise ValueError(
            f"{len(data)} bytes are not a service call, which begins with 02; "
            "clients do not publish here"
        )
    _, service, identity, length = _CALL.unpack_from(data)
    payload = _CALL.size + length
    encoding = data[_CALL.size : payload]
    if length != len(encoding) or encoding != ENCODING.encode():
        raise ValueError(f"encoding {encoding[:20]!r}; services take {ENCODING}")
    return Call(service, identity, data[payload:])


def message_frame(subscription: int, received_ns: int, payload: bytes) -> bytes:
    """Return the binary frame of a channel's message."""
    return _MESSAGE.pack(1, subscription, received_ns) + payload


def answer_frame(call: Call, payload: bytes) -> bytes:
    """Return the binary frame of the answer to a call."""
    encoding = ENCODING.encode()
    return _CALL.pack(3, call.service, call.id, len(encoding)) + encoding + payload


def text(op: str, **fields: object) -> str:
    """Return a text message of this operation; fields that are None are left out."""
    given = {name: value for name, value in fields.items() if value is not None}
    return _encode({"op": op, **given}).decode()


def parameter_values(values: dict[str, ParameterValue], identity: str | None = None) -> str:
    """Return the message with these parameters; `float64` marks that a 3 is the float 3.0."""
    parameters = [
        {"name": name, "value": value, **({"type": "float64"} if type(value) is float else {})}
        for name, value in values.items()
    ]
    return text("parameterValues", parameters=parameters, id=identity)
