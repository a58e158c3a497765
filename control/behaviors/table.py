"""Names of the behaviors, and which may follow which."""

from __future__ import annotations

import difflib
from enum import IntEnum

from quadrotor.errors import RefusedError


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


(
    _GROUND,
    _TAKE_OFF,
    _HOVER,
    _FLY_TO,
    _FOLLOW,
    _VELOCITY,
    _LAND,
    _BRAKE,
    _EXCITE,
    _NEAR,
    _EMERGENCY,
    _EXTERNAL,
) = BehaviorName

_ON_GROUND = "the vehicle is on the ground: request take_off first"
_STANDING = "the vehicle is on the ground already"
_FLYING = "the vehicle is flying already: use fly_to to change the height"
_REACHED_BY_LANDING = "ground is reached by landing: request land"
_CLIMBING = "take_off is still climbing: wait for hover, or request brake to stop here"
_MOVING = "a trajectory starts from rest: request brake and wait for hover"
_NOT_AT_REST = "a test of the gains starts from hover: request brake and wait for hover"
_NOT_STEERED = "the vehicle is not held in place now: request hover or brake first"
_NEVER_BACK = "the emergency landing is under way: request brake first to stop it in the air"
_DESCENDING = "the vehicle is landing: request hover first to abort the landing"

_IN_MOTION = {
    _GROUND: _REACHED_BY_LANDING,
    _TAKE_OFF: _FLYING,
    _FOLLOW: _MOVING,
    _EXCITE: _NOT_AT_REST,
}

REFUSALS: dict[BehaviorName, dict[BehaviorName, str]] = {
    _GROUND: {
        _GROUND: _STANDING,
        _HOVER: _ON_GROUND,
        _FLY_TO: _ON_GROUND,
        _FOLLOW: _ON_GROUND,
        _VELOCITY: _ON_GROUND,
        _LAND: _STANDING,
        _BRAKE: _ON_GROUND,
        _EXCITE: _ON_GROUND,
        _NEAR: _ON_GROUND,
        _EMERGENCY: _STANDING,
        _EXTERNAL: _ON_GROUND,
    },
    _TAKE_OFF: {
        _GROUND: _REACHED_BY_LANDING,
        _TAKE_OFF: "take_off is under way already",
        _FLY_TO: _CLIMBING,
        _FOLLOW: _CLIMBING,
        _VELOCITY: _CLIMBING,
        _EXCITE: _CLIMBING,
        _NEAR: _CLIMBING,
        _EXTERNAL: _CLIMBING,
    },
    _HOVER: {_GROUND: _REACHED_BY_LANDING, _TAKE_OFF: _FLYING},
    _FLY_TO: dict(_IN_MOTION),
    _FOLLOW: dict(_IN_MOTION),
    _VELOCITY: dict(_IN_MOTION),
    _LAND: {
        _GROUND: "land is under way already",
        _TAKE_OFF: _DESCENDING,
        _FLY_TO: _DESCENDING,
        _FOLLOW: _DESCENDING,
        _VELOCITY: _DESCENDING,
        _EXCITE: _DESCENDING,
        _NEAR: _DESCENDING,
        _EXTERNAL: _DESCENDING,
    },
    _BRAKE: dict(_IN_MOTION),
    _EXCITE: _IN_MOTION | {_EXCITE: "excite is under way already"},
    _NEAR: {
        _GROUND: _REACHED_BY_LANDING,
        _TAKE_OFF: _FLYING,
        _FLY_TO: _NOT_STEERED,
        _FOLLOW: _NOT_STEERED,
        _EXCITE: _NOT_STEERED,
        _EXTERNAL: _NOT_STEERED,
    },
    _EMERGENCY: {
        _GROUND: "emergency_landing is under way already",
        _TAKE_OFF: _NEVER_BACK,
        _FLY_TO: _NEVER_BACK,
        _FOLLOW: _NEVER_BACK,
        _EXCITE: _NEVER_BACK,
        _EXTERNAL: _NEVER_BACK,
    },
    _EXTERNAL: dict(_IN_MOTION),
}
"""REFUSALS[present][wanted] is the reason of a refusal; every other transition is allowed.

Landing again with another speed, and braking or hovering twice, are allowed, because a repeated
command must not fail."""

NEEDS_LIFT = frozenset({_HOVER, _BRAKE})
"""Behaviors refused before lift-off and after touch-down: they would hold the reference there."""


def behavior_of(name: str) -> BehaviorName:
    """Return the behavior called `name` (lower case). Raises RefusedError."""
    for behavior in BehaviorName:
        if behavior.name.lower() == name:
            return behavior
    names = [behavior.name.lower() for behavior in BehaviorName if behavior is not _GROUND]
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
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
    needs_lift = wanted is _EXCITE or (present in (_TAKE_OFF, _LAND) and wanted in NEEDS_LIFT)
    if needs_lift and not airborne:
        raise RefusedError(
            f"{name} refused: the vehicle has not left the ground; request land to stop"
        )
