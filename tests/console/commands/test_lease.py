"""Control lease: one person commands, all others ask."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.commands.lease import ABSENT, UNANSWERED, ControlLease
from quadrotor.errors import RefusedError


def held(by: str = "anna", at: float = 0.0) -> ControlLease:
    lease = ControlLease()
    lease.command(by, at)
    return lease


def test_the_first_to_command_has_control_and_others_are_refused_by_name() -> None:
    lease = held()
    with pytest.raises(RefusedError, match="anna has control"):
        lease.command("ben", 1.0)
    assert lease.holder == "anna"
    lease.command("anna", 2.0)


def test_the_holder_gives_it_when_asked() -> None:
    lease = held()
    lease.ask("ben", 1.0)
    assert lease.view(1.0).asking == "ben"
    lease.answer("anna", True, 2.0)
    assert (lease.holder, lease.view(2.0).asking) == ("ben", "")
    with pytest.raises(RefusedError, match="ben has control"):
        lease.command("anna", 3.0)


def test_the_holder_may_keep_it() -> None:
    lease = held()
    lease.ask("ben", 1.0)
    lease.answer("anna", False, 2.0)
    assert (lease.holder, lease.view(2.0).asking) == ("anna", "")


def test_a_silent_holder_gives_way_and_a_busy_one_does_not() -> None:
    lease = held()
    lease.ask("ben", 1.0)
    for second in range(1, 40):  # continues to fly, too busy to answer
        lease.command("anna", float(second))
        lease.present("ben", float(second))
    assert lease.holder == "anna"
    for tenth in range(390, 390 + int(10 * UNANSWERED) + 2):
        lease.present("anna", tenth / 10)  # is present
    assert lease.holder == "ben"


def test_the_time_left_for_an_answer_counts_down() -> None:
    lease = held()
    assert lease.view(1.0).answer_within == 0.0
    lease.ask("ben", 1.0)
    assert lease.view(4.0).answer_within == pytest.approx(UNANSWERED - 3.0)


def test_who_leaves_loses_it_after_a_while() -> None:
    lease = held()
    lease.present("anna", 3.0)
    lease.expire(3.0 + ABSENT)
    assert lease.holder == "anna"
    lease.expire(3.1 + ABSENT)
    assert lease.holder == ""
    lease.command("ben", 9.0)
    assert lease.holder == "ben"


def test_who_asked_gets_it_when_the_holder_leaves_or_gives_it_up() -> None:
    gone, given_up = held(), held()
    for lease in (gone, given_up):
        lease.ask("ben", 1.0)
    gone.expire(ABSENT + 1.0)
    given_up.release("anna", 1.0)
    assert gone.holder == given_up.holder == "ben"


def test_only_one_asks_at_a_time() -> None:
    lease = held()
    lease.ask("ben", 1.0)
    lease.ask("ben", 5.0)  # asking again does not restart the wait
    assert lease.view(5.0).answer_within == pytest.approx(UNANSWERED - 4.0)
    with pytest.raises(RefusedError, match="ben has already requested control from anna"):
        lease.ask("cleo", 2.0)


def test_only_the_holder_answers_or_gives_up() -> None:
    lease = held()
    lease.ask("ben", 1.0)
    with pytest.raises(RefusedError, match="anna has it"):
        lease.answer("ben", True, 2.0)
    with pytest.raises(RefusedError, match="anna has it"):
        lease.release("ben", 2.0)
    with pytest.raises(RefusedError, match="no one has it"):
        ControlLease().release("ben", 0.0)
    lease.answer("anna", False, 2.0)
    with pytest.raises(RefusedError, match="no pending request for control"):
        lease.answer("anna", True, 3.0)


def test_an_admin_takes_it_from_whoever_has_it() -> None:
    lease = held()
    lease.ask("ben", 1.0)
    lease.take("root", 2.0)
    assert (lease.holder, lease.view(2.0).asking) == ("root", "")


_ACTS = st.sampled_from(("command", "present", "ask", "give", "keep", "release", "wait"))


@given(st.lists(st.tuples(_ACTS, st.sampled_from("abc"), st.floats(0.0, 8.0)), max_size=60))
def test_there_is_never_more_than_one_who_may_command(story: list[tuple[str, str, float]]) -> None:
    lease, now = ControlLease(), 0.0
    for act, who, pause in story:
        now += pause
        try:
            if act in ("give", "keep"):
                lease.answer(who, act == "give", now)
            elif act == "wait":
                lease.expire(now)
            else:
                getattr(lease, act)(who, now)
        except RefusedError:
            pass
        able = [one for one in "abc" if lease.may_command(one, now)]
        assert able == ([lease.holder] if lease.holder else ["a", "b", "c"])
        assert not (lease.view(now).asking and not lease.holder)
