"""A change of a parameter by any client, over the real link, is in the history once, in order."""

from __future__ import annotations

from typing import Any

from console.parameters.history import ParameterHistory
from console.parameters.history_writer import AT_RESTART
from tests.waiting import until
from vehicle_link.parameters.messages import from_parameters, to_parameters
from vehicle_link.transport.parameter_service import ROS_REQUESTER, ParameterClient

KP, SIGMA = "control.position.kp_xy", "station.bearings.sigma"


def test_the_page_ros_and_a_restart_are_rows_in_order(linked: Any) -> None:
    history = ParameterHistory(linked.catalogue.engine, "quad1")
    linked.connect()
    assert linked.change(KP, 5.0).accepted
    assert linked.change(SIGMA, 2.5).accepted
    until(lambda: len(history.changes()) >= 2)
    ParameterClient(linked.page, "/quad1/vehicle").set({KP: 6.0})  # as `ros2 param set` does
    both = linked.call("change_parameters", parameters=to_parameters({KP: 7.0, SIGMA: 3.0}))
    assert from_parameters(both.applied) == {KP: 7.0, SIGMA: 3.0}

    def rows() -> list[tuple[Any, ...]]:
        mine = [c for c in reversed(history.changes()) if c.name in (KP, SIGMA)]
        return [(c.name, c.old, c.new, c.requester) for c in mine]

    assert until(lambda: len(rows()) == 5)
    assert [row for row in rows() if row[0] == KP] == [
        (KP, 4.0, 5.0, "ada"),
        (KP, 5.0, 6.0, ROS_REQUESTER),
        (KP, 6.0, 7.0, "ada"),
    ]
    assert [row for row in rows() if row[0] == SIGMA] == [
        (SIGMA, 1.5, 2.5, "ada"),
        (SIGMA, 2.5, 3.0, "ada"),
    ]

    linked.disconnect()
    linked.connect()  # its parameters are those of its start again
    assert until(lambda: rows()[-1] == (KP, 7.0, 4.0, AT_RESTART)), rows()
