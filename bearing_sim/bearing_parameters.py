"""Parameters of the emulated bearing sensor; all are live: a change acts at the next frame."""

from __future__ import annotations

import math

from pydantic import ConfigDict, field_validator

from bearing_sim.beacon_set import ID_MAX
from bearing_sim.beacons import parse_layout
from bearing_sim.faults.bearings import CATALOGUE
from quadrotor.errors import MeasurementError, OutOfBoundsError
from quadrotor.parameters import Parameters, parameter
from quadrotor.plain_rotations import Triple

EVERY_BEACON = "all"
BIAS_MAX = 20.0
"""Largest bias of a single beacon, in deg, on each axis."""


class BearingParameters(Parameters):
    """Parameters of the emulated bearing sensor.

    Texts are checked on each assignment: a wrong one raises OutOfBoundsError and changes nothing.
    That `range_min` does not exceed `range_max` is checked by a ParameterStore, for both at once.
    """

    model_config = ConfigDict(validate_assignment=True)

    layout: str = parameter("paper")
    """positions of the beacons: paper, wide, eight, ceiling, wall, or 'id x y z; …' in m"""
    lost: str = parameter("")
    """ids of beacons that are dark, like '2' or '1 3'; 'all' of them"""
    rate: float = parameter(30.0, unit="Hz", ge=1, le=120, step=1)
    """frames a second"""
    sigma: float = parameter(1.5, unit="°", ge=0.05, le=20, step=0.05)
    """standard deviation of the noise on each of two tangent axes"""
    distribution: str = parameter("gaussian", choices=("gaussian", "student_t"))
    """of the noise; student_t has heavy tails at the same sigma"""
    degrees_of_freedom: float = parameter(4.0, ge=2.1, le=100, step=0.1)
    """of student_t; the fewer, the heavier its tails"""
    mount_roll: float = parameter(0.0, unit="°", ge=-180, le=180, step=1)
    """turn of the sensor about body x; its axis is the body's -z axis at 0, 0, 0"""
    mount_pitch: float = parameter(0.0, unit="°", ge=-180, le=180, step=1)
    """turn of the sensor about body y"""
    mount_yaw: float = parameter(0.0, unit="°", ge=-180, le=180, step=1)
    """turn of the sensor about body z"""
    field_of_view: float = parameter(360.0, unit="°", ge=10, le=360, step=5)
    """full angle about the sensor's axis"""
    range_min: float = parameter(0.05, unit="m", ge=0.01, le=10, step=0.01)
    """nearer beacons are not seen"""
    range_max: float = parameter(20.0, unit="m", ge=0.1, le=100, step=0.1)
    """beacons farther away are not seen"""
    occlusion: float = parameter(0.0, ge=0, le=1, step=0.01)
    """share of the time each beacon is hidden, in spells"""
    occlusion_spell: float = parameter(0.5, unit="s", ge=0.02, le=30, step=0.02)
    """how long a beacon stays hidden"""
    drop_out: float = parameter(0.0, ge=0, le=1, step=0.01)
    """share of single bearings lost"""
    swap: float = parameter(0.0, ge=0, le=1, step=0.01)
    """share of frames with two identities exchanged"""
    bias_x: float = parameter(0.0, unit="°", ge=-20, le=20, step=0.1)
    """constant turn of all bearings, body x of its rotation vector"""
    bias_y: float = parameter(0.0, unit="°", ge=-20, le=20, step=0.1)
    """body y of that rotation vector"""
    bias_z: float = parameter(0.0, unit="°", ge=-20, le=20, step=0.1)
    """body z of that rotation vector"""
    beacon_bias: str = parameter("")
    """constant turn of single beacons' bearings: 'id x y z; id x y z; …', the rotation vector in
    body axes, deg, like '2 5 0 0'"""
    delay: float = parameter(0.0, unit="s", ge=0, le=0.5, step=0.001)
    """from the frame to its arrival"""
    stamp_error: float = parameter(0.0, unit="s", ge=-0.1, le=0.1, step=0.001)
    """by which frames are stamped too late; below 0 too early"""
    jitter: float = parameter(0.0, unit="s", ge=0, le=0.5, step=0.001)
    """further delay at random, 0 to this; frames stay in order"""
    seed: int = parameter(2, ge=0, le=2**31 - 1, step=1)
    """of the noise"""
    faults: str = parameter("")
    """faults with schedules, like 'bearings.lens k=0.1 from=5; bearings.swap value=1 for=2'
    (docs/how_to/faults.md)"""

    def check_together(self) -> None:
        CATALOGUE.parse(self.faults, self)
        if self.range_min > self.range_max:
            raise OutOfBoundsError(
                f"range_min = {self.range_min:g} m exceeds range_max = {self.range_max:g} m: no "
                "beacon would ever be seen; change both at once, or the other one first"
            )

    @field_validator("layout")
    @classmethod
    def _check_layout(cls, text: str) -> str:
        try:
            parse_layout(text)
        except MeasurementError as error:
            # A QuadlabError passes through pydantic unchanged.
            raise OutOfBoundsError(f"layout of the beacons: {error}") from None
        return text

    @field_validator("lost")
    @classmethod
    def _check_lost(cls, text: str) -> str:
        parse_lost(text)
        return text

    @field_validator("beacon_bias")
    @classmethod
    def _check_beacon_bias(cls, text: str) -> str:
        parse_beacon_bias(text)
        return text


def parse_lost(text: str) -> frozenset[int] | None:
    """Return the ids in a text like `1 3` or `1, 3`; None for `all`. Raises OutOfBoundsError."""
    words = text.replace(",", " ").split()
    if words == [EVERY_BEACON]:
        return None
    if not all(word.isdecimal() and int(word) <= ID_MAX for word in words):
        raise OutOfBoundsError(
            f"lost = {text!r} names no beacons; allowed are ids 0 to {ID_MAX} like '2' or '1 3', "
            f"'{EVERY_BEACON}', or nothing"
        )
    return frozenset(map(int, words))


def parse_beacon_bias(text: str) -> dict[int, Triple]:
    """Return, by id, the rotation vectors (deg, body axes) of a text like `2 5 0 0; 3 0 1 0`.

    Raises OutOfBoundsError.
    """
    found: dict[int, Triple] = {}
    for part in filter(None, (one.strip() for one in text.split(";"))):
        words = part.replace(",", " ").split()
        try:
            id, (x, y, z) = int(words[0]), map(float, words[1:])
            known = 0 <= id <= ID_MAX and id not in found
            sound = known and all(math.isfinite(v) and abs(v) <= BIAS_MAX for v in (x, y, z))
        except ValueError:
            sound = False
        if not sound:
            raise OutOfBoundsError(
                f"beacon_bias = {text!r:.80}: {part!r:.40} is not a bias; allowed is 'id x y z' "
                f"for each beacon once, separated by semicolons, each of x y z -{BIAS_MAX:g} to "
                f"{BIAS_MAX:g}°"
            )
        found[id] = (x, y, z)
    return found
