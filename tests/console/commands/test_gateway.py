"""A reset of the simulated vehicle is announced to the vehicle, and done in any case."""

from __future__ import annotations

from typing import Any
from unittest.mock import MagicMock

import pytest

from console.commands.gateway import CommandGateway
from quadrotor.errors import NoAnswerError
from vehicle_link.commands import COMMANDS
from vehicle_link.messages import new


class FakeNode:
    """Node whose clients record the address of each call; `absent` do not answer."""

    def __init__(self) -> None:
        self.called: list[str] = []
        self.absent: set[str] = set()
        self.handlers: dict[str, Any] = {}

    def client(self, address: str, service: str) -> Any:
        def call(_: Any, timeout: float) -> Any:
            self.called.append(address)
            if address in self.absent:
                raise NoAnswerError(f"no answer in {timeout} s")
            return new(f"{service}_Response", accepted=True)

        return MagicMock(call=call)

    def serve(self, address: str, _: str, handler: Any, **__: Any) -> None:
        self.handlers[address] = handler


@pytest.mark.parametrize(
    ("action", "absent", "refusal", "called"),
    [
        ("reset", set(), "", ["expect_move", "simulator/simulation"]),
        ("reset", {"expect_move"}, "", ["expect_move", "simulator/simulation"]),
        ("reset", set(), "the link is lost", ["simulator/simulation"]),
        ("swap_battery", set(), "", ["simulator/simulation"]),
    ],
)
def test_a_reset_is_announced_first_and_done_without_an_answer_too(
    action: str, absent: set[str], refusal: str, called: list[str]
) -> None:
    node: Any = FakeNode()
    node.absent = absent
    CommandGateway(
        node, MagicMock(), lambda _: refusal, lambda _: 0, MagicMock(), MagicMock(), MagicMock()
    ).serve()
    service = COMMANDS["simulation"].service
    request = new(f"{service}_Request", request_id="1", requester="anna", action=action)
    assert node.handlers["station/simulation"](request).accepted
    assert node.called == called
