"""A reset of the simulated vehicle is announced first, and done in any case; behaviors that the
vehicle accepted are told.
"""

from __future__ import annotations

from typing import Any
from unittest.mock import MagicMock

import pytest

from console.commands.gateway import CommandGateway
from quadrotor.errors import NoAnswerError
from vehicle_link.commands import COMMANDS
from vehicle_link.messages import new
from vehicle_link.parameters.messages import to_parameters


class FakeNode:
    """Node whose clients record the address of each call; `absent` do not answer."""

    def __init__(self) -> None:
        self.called: list[str] = []
        self.absent: set[str] = set()
        self.handlers: dict[str, Any] = {}
        self.accepts = True

    def client(self, address: str, service: str) -> Any:
        def call(_: Any, timeout: float) -> Any:
            self.called.append(address)
            if address in self.absent:
                raise NoAnswerError(f"no answer in {timeout} s")
            return new(f"{service}_Response", accepted=self.accepts)

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


@pytest.mark.parametrize("accepted", [True, False])
def test_a_behavior_is_told_once_the_vehicle_has_accepted_it(accepted: bool) -> None:
    node: Any = FakeNode()
    node.accepts = accepted
    told: list[Any] = []
    CommandGateway(
        node,
        MagicMock(),
        lambda _: "",
        lambda _: 0,
        MagicMock(),
        MagicMock(),
        MagicMock(),
        lambda name, given: told.append((name, given)),
    ).serve()
    request = new(
        f"{COMMANDS['start_behavior'].service}_Request",
        request_id="1",
        requester="anna",
        name="follow_trajectory",
        arguments=to_parameters({"trajectory": "circle", "laps": 2}),
    )
    assert node.handlers["station/start_behavior"](request).accepted == accepted
    assert told == [("follow_trajectory", {"trajectory": "circle", "laps": 2})] * accepted
