"""The table of transitions, cell by cell, and the texts of its refusals."""

from __future__ import annotations

import pytest

from control.behaviors.table import REFUSALS, BehaviorName, behavior_of, check_transition
from quadrotor.errors import RefusedError

# Rows: present behavior. Columns: ground, take_off, hover, fly_to, follow, velocity, land, brake,
# excite, near_hovering, emergency_landing, external.
# "+" allowed, "a" allowed only when airborne, "-" refused.
EXPECTED = {
    BehaviorName.GROUND: "-+----------",
    BehaviorName.TAKE_OFF: "--a---+a--+-",
    BehaviorName.HOVER: "--++++++a+++",
    BehaviorName.FLY_TO: "--++-+++-+++",
    BehaviorName.FOLLOW_TRAJECTORY: "--++-+++-+++",
    BehaviorName.VELOCITY: "--++-+++-+++",
    BehaviorName.LAND: "--a---+a--+-",
    BehaviorName.BRAKE: "--++-+++-+++",
    BehaviorName.EXCITE: "--++-+++-+++",
    BehaviorName.NEAR_HOVERING: "--+--+++-++-",
    BehaviorName.EMERGENCY_LANDING: "--+--+++-++-",
    BehaviorName.EXTERNAL: "--++-+++-+++",
}


def refusal(
    present: BehaviorName, wanted: BehaviorName, armed: bool = True, airborne: bool = True
) -> str:
    try:
        check_transition(present, wanted, armed, airborne)
    except RefusedError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("present", list(BehaviorName))
def test_every_cell_of_the_table(present: BehaviorName) -> None:
    found = ""
    for wanted in BehaviorName:
        in_the_air = refusal(present, wanted)
        on_the_ground = refusal(present, wanted, airborne=False)
        if in_the_air == "":
            found += "+" if on_the_ground == "" else "a"
            assert on_the_ground == "" or "not left the ground" in on_the_ground
        else:
            found += "-"
            assert in_the_air == on_the_ground
            assert in_the_air.startswith(f"{wanted.name.lower()} refused: ")
        assert refusal(present, wanted, armed=False).endswith("arm the vehicle first")
    assert found == EXPECTED[present]


def test_every_refusal_says_what_to_do_or_why() -> None:
    for row in REFUSALS.values():
        for reason in row.values():
            helps = (": ", "already", "under way")
            assert any(word in reason for word in helps), reason
            assert "\n" not in reason
            assert len(reason) < 100


@pytest.mark.parametrize("present", [b for b in BehaviorName if b is not BehaviorName.GROUND])
def test_land_is_possible_from_every_flight(present: BehaviorName) -> None:
    assert refusal(present, BehaviorName.LAND) == ""
    assert refusal(present, BehaviorName.LAND, airborne=False) == ""


def test_names_are_lower_case_and_a_slip_is_answered_with_a_guess() -> None:
    assert behavior_of("take_off") is BehaviorName.TAKE_OFF
    with pytest.raises(RefusedError, match=r"'takeoff': did you mean take_off\?"):
        behavior_of("takeoff")
    with pytest.raises(RefusedError, match="there are take_off, hover, fly_to"):
        behavior_of("xyz")
    with pytest.raises(RefusedError):
        behavior_of("LAND")


def test_the_numbers_of_the_status_record_do_not_move() -> None:
    assert [b.value for b in BehaviorName] == list(range(12))
    assert BehaviorName(0) is BehaviorName.GROUND
    assert BehaviorName(7) is BehaviorName.BRAKE
    assert BehaviorName(8) is BehaviorName.EXCITE
    assert BehaviorName(10) is BehaviorName.EMERGENCY_LANDING
