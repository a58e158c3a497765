"""The output of every tracking system: frames of named bodies with the system's own stamps."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

from estimation.tags.tag_bearings import Sighting
from quadrotor.plain_rotations import Array


class Body(NamedTuple):
    """A rigid body, or a single marker, as the tracking system sees it."""

    name: str
    """The system's own name of the body."""
    position_w: Array
    """(3,), m, world frame, z up."""
    quaternion_wb: Array | None
    """(4,), w x y z, body to world; None for a single marker, which has only a position."""
    covariance: Array | None = None
    """(6, 6) of the position, m, and of a turn in body axes, rad, if the system tells it."""


class Frame(NamedTuple):
    """All bodies seen at one instant, without those that were not seen."""

    stamp_ns: int | None
    """Time of the exposure on the system's own clock, of any epoch; None when it has none."""
    received_ns: int
    """Time of the frame's arrival on the host's steady clock, ns."""
    bodies: tuple[Body, ...] = ()
    beacons: Sighting | None = None
    """Bearings of a camera on the vehicle."""
    doubt: str = ""
    """A warning about the frame, which is still used."""


def name_of(camera: int | Path) -> str:
    """Return the name of a camera in messages and in the file of tags."""
    return camera.stem if isinstance(camera, Path) else str(camera)


class Source(Protocol):
    """A tracking system's client."""

    def frames(self) -> Iterator[Frame]:
        """Yield each frame as it arrives, waiting for it.

        Raises:
            UnreachableError: no server answers, or it has stopped sending.
            MeasurementError: a message cannot be read as poses.
        """
        ...

    def close(self) -> None: ...
