"""Parameters of the emulated bearing sensor, each live: a change acts at the next frame."""

from __future__ import annotations

from pydantic import ConfigDict, field_validator

from bearing_sim.beacon_set import ID_MAX
from bearing_sim.beacons import parse_layout
from quadrotor.errors import MeasurementError, OutOfBoundsError
from quadrotor.parameters import Parameters, parameter

EVERY_BEACON = "all"


class BearingParameters(Parameters):
    """The bearing sensor that is not on the vehicle.

    Texts are checked on each assignment: a wrong one raises OutOfBoundsError and changes nothing.
    That `range_min` is not beyond `range_max` is checked by a ParameterStore, for both at once.
    """

    model_config = ConfigDict(validate_assignment=True)

    layout: str = parameter(
        "paper",
        description="where the beacons stand: paper, wide, eight, ceiling, wall, "
        "or 'id x y z; …' in m",
    )
    lost: str = parameter(
        "", description="ids of beacons that are dark, like '2' or '1 3'; 'all' of them"
    )
    rate: float = parameter(30.0, unit="Hz", ge=1, le=120, step=1, description="frames a second")
    sigma: float = parameter(
        1.5,
        unit="deg",
        ge=0.05,
        le=20,
        step=0.05,
        description="standard deviation of the noise on each of two tangent axes",
    )
    distribution: str = parameter(
        "gaussian",
        choices=("gaussian", "student_t"),
        description="of the noise; student_t has heavy tails at the same sigma",
    )
    degrees_of_freedom: float = parameter(
        4.0, ge=2.1, le=100, step=0.1, description="of student_t; the fewer, the heavier its tails"
    )
    mount_roll: float = parameter(
        0.0,
        unit="deg",
        ge=-180,
        le=180,
        step=1,
        description="turn of the sensor about body x; its axis is the body's -z axis at 0, 0, 0",
    )
    mount_pitch: float = parameter(
        0.0, unit="deg", ge=-180, le=180, step=1, description="turn of the sensor about body y"
    )
    mount_yaw: float = parameter(
        0.0, unit="deg", ge=-180, le=180, step=1, description="turn of the sensor about body z"
    )
    field_of_view: float = parameter(
        360.0, unit="deg", ge=10, le=360, step=5, description="full angle about the sensor's axis"
    )
    range_min: float = parameter(
        0.05, unit="m", ge=0.01, le=10, step=0.01, description="nearer beacons are not seen"
    )
    range_max: float = parameter(
        20.0, unit="m", ge=0.1, le=100, step=0.1, description="beacons farther away are not seen"
    )
    occlusion: float = parameter(
        0.0, ge=0, le=1, step=0.01, description="share of the time each beacon is hidden, in spells"
    )
    occlusion_spell: float = parameter(
        0.5, unit="s", ge=0.02, le=30, step=0.02, description="how long a beacon stays hidden"
    )
    drop_out: float = parameter(
        0.0, ge=0, le=1, step=0.01, description="share of single bearings lost"
    )
    swap: float = parameter(
        0.0, ge=0, le=1, step=0.01, description="share of frames with two identities exchanged"
    )
    bias_x: float = parameter(
        0.0,
        unit="deg",
        ge=-20,
        le=20,
        step=0.1,
        description="constant turn of all bearings, body x of its rotation vector",
    )
    bias_y: float = parameter(
        0.0, unit="deg", ge=-20, le=20, step=0.1, description="body y of that rotation vector"
    )
    bias_z: float = parameter(
        0.0, unit="deg", ge=-20, le=20, step=0.1, description="body z of that rotation vector"
    )
    delay: float = parameter(
        0.0, unit="s", ge=0, le=0.5, step=0.001, description="from the frame to its arrival"
    )
    jitter: float = parameter(
        0.0,
        unit="s",
        ge=0,
        le=0.5,
        step=0.001,
        description="further delay at random, 0 to this; frames stay in order",
    )
    seed: int = parameter(2, ge=0, le=2**31 - 1, step=1, description="of the noise")

    def check_together(self) -> None:
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
            # A QuadlabError passes through pydantic as it is.
            raise OutOfBoundsError(f"layout of the beacons: {error}") from None
        return text

    @field_validator("lost")
    @classmethod
    def _check_lost(cls, text: str) -> str:
        parse_lost(text)
        return text


def parse_lost(text: str) -> frozenset[int] | None:
    """The ids in a text like `1 3` or `1, 3`; None for `all`. Raises OutOfBoundsError."""
    words = text.replace(",", " ").split()
    if words == [EVERY_BEACON]:
        return None
    if not all(word.isdecimal() and int(word) <= ID_MAX for word in words):
        raise OutOfBoundsError(
            f"lost = {text!r} names no beacons; allowed are ids 0 to {ID_MAX} like '2' or '1 3', "
            f"'{EVERY_BEACON}', or nothing"
        )
    return frozenset(map(int, words))
