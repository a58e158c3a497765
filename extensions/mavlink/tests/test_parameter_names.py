"""Every parameter of the vehicle has one short name, and its values survive four bytes."""

from __future__ import annotations

import queue
import struct
from collections import Counter
from dataclasses import replace

import pytest

from extensions.mavlink.dialect import mavlink
from extensions.mavlink.parameter_names import (
    HIGHEST,
    INT32,
    LOWEST,
    decoded,
    encoded,
    has_short_name,
    short_name,
)
from extensions.mavlink.parameter_server import ParameterServer
from quadrotor.errors import WrongTypeError
from quadrotor.parameter_description import ParameterDescription
from quadrotor.parameters import ParameterStore
from vehicle.parameters import new_parameters

STORE = ParameterStore(new_parameters())
DESCRIPTIONS = STORE.descriptions()


def test_no_two_parameters_have_the_same_short_name() -> None:
    counts = Counter(short_name(one.name) for one in DESCRIPTIONS)
    assert [name for name, count in counts.items() if count > 1] == []
    assert all(len(name) <= 16 and name.isascii() for name in counts)


def test_a_short_name_is_a_function_of_the_name_alone() -> None:
    assert short_name("control.position.kp_xy") == "C_POSITION_KP_XY"
    assert short_name("behavior.trajectory_speed_max") == "B_TRJC_SPEED_MAX"


@pytest.mark.parametrize(
    "one", [d for d in DESCRIPTIONS if has_short_name(d)], ids=lambda one: one.name
)
def test_the_default_comes_back_as_it_was(one: ParameterDescription) -> None:
    sent, kind = encoded(one, one.default)
    as_received = struct.unpack("<f", struct.pack("<f", sent))[0]
    found = decoded(one, as_received, kind)
    if one.type == "float" and len(str(one.default)) > 8:  # more digits than four bytes have
        assert found == pytest.approx(one.default, rel=1e-6)
    else:
        assert found == one.default


def test_a_negative_integer_comes_back_as_it_was() -> None:
    one = next(d for d in DESCRIPTIONS if d.type == "int")
    for value in (-1, -7, 0, 2**30):
        sent, kind = encoded(one, value)
        assert decoded(one, struct.unpack("<f", struct.pack("<f", sent))[0], kind) == value


def over_the_wire(message: mavlink.MAVLink_message) -> mavlink.MAVLink_message:
    """Return a message as a peer, pymavlink's parser, reads its bytes."""
    sent = bytes(message.pack(mavlink.MAVLink(None)))
    [received] = mavlink.MAVLink(None).parse_buffer(sent)
    return received


def test_integers_reach_a_peer_unchanged_or_are_left_out_with_a_line() -> None:
    one = next(d for d in DESCRIPTIONS if d.type == "int")
    limits = {
        "a.narrow": (LOWEST, HIGHEST),
        "a.high": (0, HIGHEST + 1),
        "a.low": (LOWEST - 1, 0),
        "a.wide": (0, 2**53),
        "a.unlimited": (None, None),
    }
    described = [
        replace(one, name=name, minimum=low, maximum=high) for name, (low, high) in limits.items()
    ]
    server = ParameterServer(queue.SimpleQueue(), lambda *_: None)
    lines = server.load(described, dict.fromkeys(limits, 0))
    assert [line.split()[1] for line in lines] == list(limits)[1:]
    assert all(server.message(short_name(name)) is None for name in list(limits)[1:])
    for value in (LOWEST, -1, 0, 2**24 + 1, HIGHEST):
        server.values["a.narrow"] = value
        received = over_the_wire(server.message("A_NARROW"))
        assert decoded(one, received.param_value, received.param_type) == value
        assert (received.param_type, received.param_count) == (INT32, 1)


def test_a_number_that_is_no_choice_is_refused_with_the_choices() -> None:
    one = next(d for d in DESCRIPTIONS if d.name == "estimation.shadow_source")
    with pytest.raises(WrongTypeError, match=r"is 9; there are 0 same, 1 poses"):
        decoded(one, struct.unpack("<f", struct.pack("<i", 9))[0], INT32)
    gain = next(d for d in DESCRIPTIONS if d.name == "control.position.kp_xy")
    with pytest.raises(WrongTypeError, match="is a float; it was sent as type 6"):
        decoded(gain, 1.0, INT32)
