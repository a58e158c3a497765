"""Names of the behaviors, and which may follow which."""

from __future__ import annotations

from enum import IntEnum

from quadrotor.errors import RefusedError
from quadrotor.similar_names import did_you_mean


class BehaviorName(IntEnum):
    """The name of a behavior, also its number in STATUS records."""

    GROUND = 0  # on the ground, motors idle
    TAKE_OFF = 1
    HOVER = 2
    FLY_TO = 3
    FOLLOW_TRAJECTORY = 4
    VELOCITY = 5  # sticks
    LAND = 6
    BRAKE = 7  # to a stop, then hover
    EXCITE = 8  # steps of the reference, for tuning
    NEAR_HOVERING = 9  # sticks are angles, which the microcontroller holds
    EMERGENCY_LANDING = 10  # level descent, without a pose
    EXTERNAL = 11  # references of another program


B = BehaviorName

_ON_GROUND = "the vehicle is on the ground: take off first"
_STANDING = "the vehicle is on the ground already"
_FLYING = "the vehicle is flying already: fly to another height"
_REACHED_BY_LANDING = "the vehicle gets to the ground by landing: land instead"
_CLIMBING = "the vehicle is still climbing: wait until it hovers, or brake to stop here"
_MOVING = "a trajectory starts from rest: brake and wait until it hovers"
_NOT_AT_REST = "a test of the gains starts from hover: brake and wait until it hovers"
_NOT_STEERED = "the vehicle does not hold its position now: hover or brake first"
_NEVER_BACK = "the emergency landing is under way: brake first to stop it in the air"
_DESCENDING = "the vehicle is landing: hover first to abort the landing"

_IN_MOTION = {
    B.GROUND: _REACHED_BY_LANDING,
    B.TAKE_OFF: _FLYING,
    B.FOLLOW_TRAJECTORY: _MOVING,
    B.EXCITE: _NOT_AT_REST,
}
_TO_THE_AIR = (B.HOVER, B.FLY_TO, B.FOLLOW_TRAJECTORY, B.VELOCITY, B.BRAKE, B.EXCITE)
_PLANNED = (B.FLY_TO, B.FOLLOW_TRAJECTORY, B.EXCITE, B.EXTERNAL)
_IN_PLACE = (B.FLY_TO, B.FOLLOW_TRAJECTORY, B.VELOCITY, B.EXCITE, B.NEAR_HOVERING, B.EXTERNAL)

REFUSALS: dict[BehaviorName, dict[BehaviorName, str]] = {
    B.GROUND: dict.fromkeys((*_TO_THE_AIR, B.NEAR_HOVERING, B.EXTERNAL), _ON_GROUND)
    | dict.fromkeys((B.GROUND, B.LAND, B.EMERGENCY_LANDING), _STANDING),
    B.TAKE_OFF: dict.fromkeys(_IN_PLACE, _CLIMBING)
    | {B.GROUND: _REACHED_BY_LANDING, B.TAKE_OFF: "take_off is under way already"},
    B.HOVER: {B.GROUND: _REACHED_BY_LANDING, B.TAKE_OFF: _FLYING},
    **dict.fromkeys((B.FLY_TO, B.FOLLOW_TRAJECTORY, B.VELOCITY, B.BRAKE, B.EXTERNAL), _IN_MOTION),
    B.LAND: dict.fromkeys((B.TAKE_OFF, *_IN_PLACE), _DESCENDING)
    | {B.GROUND: "land is under way already"},
    B.EXCITE: _IN_MOTION | {B.EXCITE: "excite is under way already"},
    B.NEAR_HOVERING: dict.fromkeys(_PLANNED, _NOT_STEERED)
    | {B.GROUND: _REACHED_BY_LANDING, B.TAKE_OFF: _FLYING},
    B.EMERGENCY_LANDING: dict.fromkeys((B.TAKE_OFF, *_PLANNED), _NEVER_BACK)
    | {B.GROUND: "emergency_landing is under way already"},
}
"""REFUSALS[present][wanted] is the reason of a refusal; every other transition is allowed.

Landing again with another speed, and braking or hovering twice, are allowed, because a repeated
command must not fail."""

NEEDS_LIFT = frozenset({B.HOVER, B.BRAKE})
"""Behaviors refused before lift-off and after touch-down: they would hold the reference there."""


def behavior_of(name: str) -> BehaviorName:
    """Return the behavior called `name` (lower case). Raises RefusedError."""
    for behavior in BehaviorName:
        if behavior.name.lower() == name:
            return behavior
    names = [behavior.name.lower() for behavior in BehaviorName if behavior is not B.GROUND]
    hint = did_you_mean(name, names, after=" ")
    raise RefusedError(f"unknown behavior {name!r}: {hint}there are {', '.join(names)}")


def check_transition(
    present: BehaviorName, wanted: BehaviorName, armed: bool, airborne: bool
) -> None:
    """Raise RefusedError with the reason when `wanted` may not follow `present`."""
    name = wanted.name.lower()
    if not armed:
        raise RefusedError(f"{name} refused: the motors are off; arm the vehicle first")
    reason = REFUSALS[present].get(wanted)
    if reason is not None:
        raise RefusedError(f"{name} refused: {reason}")
    needs_lift = wanted is B.EXCITE or (present in (B.TAKE_OFF, B.LAND) and wanted in NEEDS_LIFT)
    if needs_lift and not airborne:
        raise RefusedError(f"{name} refused: the vehicle has not left the ground; land to stop")
