"""The output of every tracking system: frames of named bodies with the system's own stamps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

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


class Connection(NamedTuple):
    """The address and the bodies that a tracking system's client is given.

    Attributes:
        host, port: the address of the server, or where to listen.
        session: the session with the station.
        bodies: the system's name of each vehicle's body.
    """

    host: str
    port: int
    session: Any
    bodies: Mapping[str, str]


class System(Protocol):
    """A tracking system that an extension offers (`quadrotor.extension.TrackingSystem`)."""

    def check(self, bodies: Mapping[str, str]) -> None:
        """Raise UsageError for names of bodies that the system cannot have."""
        ...

    def open(self, connection: Connection) -> Source:
        """Return the connected client.

        Raises UsageError for a mistake of the user; another QuadlabError, after which it is tried
        again.
        """
        ...


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
