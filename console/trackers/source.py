"""The output of every tracking system: frames of named bodies with the system's own stamps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

from console.trackers.camera_figures import View
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


class Sighting(NamedTuple):
    """The beacons in one picture: ids, unit vectors (N, 3) in body axes, rad on each of two tangent
    axes, and the pixels (N, 2) of their centres.
    """

    beacon_ids: list[int]
    bearings_b: Array
    sigma: float
    pixels: Array


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
        data: the data folder.
    """

    host: str
    port: int
    session: Any
    bodies: Mapping[str, str]
    data: Path


class System(Protocol):
    """A tracking system that an extension offers (`quadrotor.extension.TrackingSystem`).

    A system of cameras also has the attributes of `HasViews`.
    """

    def check(self, bodies: Mapping[str, str]) -> None:
        """Raise UsageError for names of bodies that the system cannot have."""
        ...

    def open(self, connection: Connection) -> Source:
        """Return the connected client.

        Raises UsageError for a mistake of the user; another QuadlabError, after which it is tried
        again.
        """
        ...


@runtime_checkable
class HasViews(Protocol):
    """A system of cameras, whose pictures are shown to people.

    Attributes:
        where: the cameras, for messages.
        views: one for each camera.
    """

    where: str
    views: Sequence[View]


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
