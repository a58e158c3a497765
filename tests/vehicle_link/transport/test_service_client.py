"""Tests of what a client of a service does with an answer, and with none."""

from __future__ import annotations

from typing import Any

import pytest

from quadrotor.errors import NoAnswerError, RefusedError
from tests.support.clients import FakeClient
from vehicle_link.messages import new
from vehicle_link.topics.table import SERVICES

BENCH = SERVICES["bench"]


def test_a_lost_answer_is_requested_again_with_the_same_id_and_no_more_than_said() -> None:
    asked: list[Any] = []

    def answer(request: Any) -> Any:
        asked.append(request)
        if len(asked) < 2:
            raise NoAnswerError("lost")
        return new(f"{BENCH}_Response", accepted=True)

    client = FakeClient("/quad1/bench", BENCH, answer)
    assert client.ask("anna", tries=2, motor=1).accepted
    assert len({request.request_id for request in asked}) == 1
    assert asked[0].request_id
    assert (asked[0].requester, asked[0].motor) == ("anna", 1)
    asked.clear()
    with pytest.raises(NoAnswerError):
        client.ask("anna", motor=1)


@pytest.mark.parametrize("reason", ["the motors are on", ""])
def test_a_refusal_is_an_error_with_the_reason_or_the_services_name(reason: str) -> None:
    refused = new(f"{BENCH}_Response", accepted=False, reason=reason)
    client = FakeClient("/quad1/bench", BENCH, lambda _: refused)
    with pytest.raises(RefusedError, match=reason or "bench was refused"):
        client.ask("anna")
