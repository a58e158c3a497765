"""The last act of a person on the parameters is known, with the values that take it back."""

from __future__ import annotations

from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.last_change import LastChange
from vehicle_link.parameters.steps import step_towards

SECOND_NS = 1_000_000_000


def act(*changes: tuple[float, str, float, float, str, int]) -> LastChange:
    """Return the last act of changes (s, name, old, new, requester, revision)."""
    last = LastChange()
    for at, name, old, new, who, revision in changes:
        stamp_ns = round(at * SECOND_NS)
        last.note(ParameterChange(stamp_ns, name, old, new, who, revision))
    return last


def test_the_values_of_one_drag_are_one_act_that_goes_back_to_its_start() -> None:
    drag = [(0.1 * k, "kp", 4.0 + k, 5.0 + k, "ann", k) for k in range(9)]
    assert act(*drag).old == {"kp": 4.0}
    assert act(*drag, (9.0, "kp", 13.0, 14.0, "ann", 10)).old == {"kp": 13.0}
    assert act(*drag, (1.0, "kv", 3.0, 4.0, "ann", 10)).old == {"kv": 3.0}


def test_values_changed_at_once_go_back_together() -> None:
    both = [(0.0, "kp", 4.0, 6.0, "ann", 3), (0.0, "kv", 3.0, 5.0, "ann", 3)]
    assert act(*both).old == {"kp": 4.0, "kv": 3.0}


def test_what_the_vehicle_or_others_change_is_no_act_on_the_vehicle() -> None:
    kept = act(
        (0.0, "kp", 4.0, 6.0, "ann", 3),
        (0.1, "kp", 6.0, 5.0, "vehicle", 4),
        (0.2, "simulator.mass", 1.0, 2.0, "ann", 1),
    )
    assert kept.old == {"kp": 4.0}
    kept.forget()
    assert kept.old == {}


def test_a_step_reaches_a_near_value_and_goes_towards_a_far_one() -> None:
    assert step_towards(4.0, 13.0, 4.0) == 9.0
    assert step_towards(4.0, 5.0, 4.0) == 4.0
    assert step_towards(None, 1.0, 9.0) == 9.0
    assert step_towards(None, "poses", "bearings") == "bearings"
