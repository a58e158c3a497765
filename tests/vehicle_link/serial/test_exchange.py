"""Sets and requests are repeated until answered as expected, and reported if they never are."""

from __future__ import annotations

from itertools import pairwise

import pytest

from vehicle_link.serial import commands as c
from vehicle_link.serial.exchange import (
    MIRROR_KEY,
    TRIES,
    Exchange,
    Request,
    ask,
    confirm,
    decode_reply,
    mirror,
    set_value,
)
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, Id

COMMAND = (1, 2, 3, 4)


def one(data: bytes) -> Frame:
    (frame,) = FrameDecoder().feed(data)
    return frame


def times_ms(exchange: Exchange, until_ms: int) -> list[int]:
    """Return the times of sending, with a service every millisecond."""
    return [ms for ms in range(until_ms) if exchange.service(ms * 1e-3, COMMAND)]


def test_what_is_not_answered_is_sent_40_times_each_25_ms_then_each_second() -> None:
    exchange = Exchange([confirm(Id.ROBOT_ID, 1)])
    sent = times_ms(exchange, 5_000)
    assert {b - a for a, b in pairwise(sent[:TRIES])} <= {25, 26}
    assert {b - a for a, b in pairwise(sent[TRIES:])} <= {1000, 1001}
    assert exchange.failures == [
        "microcontroller: could not confirm that robot_id is 1 in 40 tries, 1.0 s; it answered "
        "nothing. Check the cables, the ports and its firmware"
    ]


def test_what_is_not_persistent_is_given_up() -> None:
    exchange = Exchange([set_value(Id.MOTOR_STATE, 1, persistent=False)])
    assert len(times_ms(exchange, 5_000)) == TRIES
    assert len(exchange.failures) == 1


@pytest.mark.parametrize(
    ("request_", "frame"),
    [
        (set_value(Id.GAIN_P, 600), c.encode_set(COMMAND, Id.GAIN_P, 600)),
        (ask(Id.BATTERY), c.encode_request(COMMAND, Id.BATTERY)),
        (confirm(Id.ROBOT_ID, 1), c.encode_request(COMMAND, Id.ROBOT_ID)),
        (mirror(MIRROR), c.encode_mirror(COMMAND, MIRROR)),
    ],
)
def test_every_frame_carries_the_command_of_the_moment(request_: Request, frame: bytes) -> None:
    assert Exchange([request_]).service(0.0, COMMAND) == [frame]


def test_only_the_expected_answer_settles() -> None:
    exchange = Exchange([set_value(Id.GAIN_P, 600)])
    assert exchange.settle(Id.GAIN_D, 600) is None
    assert exchange.settle(Id.GAIN_P, 500) is None
    times_ms(exchange, 2_000)
    assert "it answered 500." in exchange.failures[0]
    settled = exchange.settle(Id.GAIN_P, 600)
    assert settled is not None
    assert settled.key == Id.GAIN_P
    assert exchange.open == []


def test_any_answer_settles_a_question() -> None:
    exchange = Exchange([ask(Id.BATTERY)])
    assert exchange.settle(Id.BATTERY, -7) is not None


def test_what_is_held_back_is_not_sent_and_says_why() -> None:
    request = set_value(Id.MOTOR_STATE, 1)
    exchange = Exchange([request])
    request.hold = "it is not recognised yet"
    assert times_ms(exchange, 500) == []
    assert request.answer == "nothing: it is not recognised yet"
    request.hold = ""
    assert len(exchange.service(1.0, COMMAND)) == 1


def test_a_new_request_about_the_same_id_replaces_the_open_one() -> None:
    exchange = Exchange([ask(Id.BATTERY)])
    exchange.put(set_value(Id.MOTOR_STATE, 1))
    exchange.put(set_value(Id.MOTOR_STATE, 3))
    assert [(r.key, r.expected) for r in exchange.open] == [(Id.BATTERY, None), (Id.MOTOR_STATE, 3)]


def test_replies_name_what_they_answer() -> None:
    assert decode_reply(one(c.encode_value(Id.BATTERY, 148))) == (Id.BATTERY, 148)
    assert decode_reply(one(c.encode_mirrored(MIRROR))) == (MIRROR_KEY, MIRROR)
    assert decode_reply(one(c.encode_data(bytes(20)))) is None


@pytest.mark.parametrize("id", [-1, -32768, 65, 32767])
def test_no_value_of_a_strange_id_confirms_the_mirror(id: int) -> None:
    exchange = Exchange([mirror(MIRROR)])
    reply = decode_reply(one(c.encode_value(id, 0)))
    assert reply is not None
    assert exchange.settle(*reply) is None
    assert exchange.settle(MIRROR_KEY, tuple(reversed(MIRROR))) is None
    assert exchange.settle(MIRROR_KEY, tuple(map(int, MIRROR))) is not None
