"""Parts that extensions add to the station of each vehicle."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bearing_sim.emulator import BearingMeasurement
from bearing_sim.pose_measurement import PoseMeasurement
from quadrotor.parameters import Parameters
from quadrotor.records import Array

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class PartContext:
    """The parts of the station that an added part may use.

    Attributes:
        vehicle: the vehicle's name.
        parameters: its own parameters, if it has any, live: read them when they are needed.
        publish: publishes a message of a topic: topic, payload and stamp (ns). Raises LinkError.
        say: tells operators a line.
        is_wanted: returns whether the messages of a topic are recorded or shown.
    """

    vehicle: str
    parameters: Parameters | None
    publish: Callable[[str, bytes, int], None]
    say: Callable[[str], None]
    is_wanted: Callable[[str], bool]


class Part:
    """A part of the station; it overrides the methods that it needs.

    They are called by threads of the station that must not wait: each may cost microseconds.
    """

    def telemetry(self, payload: bytes) -> None:
        """Take one packet of telemetry."""

    def status(self, armed: bool, starting: bool) -> None:
        """Take the vehicle's status."""

    def truth(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Take a pose of the simulated vehicle."""

    def pose(self, pose: PoseMeasurement) -> None:
        """Take a pose of the tracker."""

    def bearings(self, frame: BearingMeasurement) -> None:
        """Take a frame of bearings."""

    def close(self) -> None:
        """End its threads and processes."""


class Parts(Part):
    """All parts, as one. A part whose method raises an error is closed and takes nothing more.

    Args:
        parts: by name.
        on_failure: called with the name of a part that failed, and the line for operators.
    """

    def __init__(self, parts: Mapping[str, Part], on_failure: Callable[[str, str], None]) -> None:
        self.by_name, self._on_failure = dict(parts), on_failure

    def telemetry(self, payload: bytes) -> None:
        self._each(lambda part: part.telemetry(payload))

    def status(self, armed: bool, starting: bool) -> None:
        self._each(lambda part: part.status(armed, starting))

    def truth(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        self._each(lambda part: part.truth(stamp_ns, position_w, quaternion_wb))

    def pose(self, pose: PoseMeasurement) -> None:
        self._each(lambda part: part.pose(pose))

    def bearings(self, frame: BearingMeasurement) -> None:
        self._each(lambda part: part.bearings(frame))

    def close(self) -> None:
        self._each(lambda part: part.close())

    def _each(self, act: Callable[[Part], None]) -> None:
        for name, part in tuple(self.by_name.items()):
            try:
                act(part)
            except Exception as error:  # code of others, in threads that serve the flight
                self._drop(name, part, error)

    def _drop(self, name: str, part: Part, error: Exception) -> None:
        if self.by_name.pop(name, None) is None:
            return  # another thread dropped it first
        log.exception("the part %s of the station", name, exc_info=error)
        self._on_failure(name, f"the part {name} of the station ended: {error!r}; see its log")
        try:
            part.close()
        except Exception:
            log.exception("the end of the part %s of the station", name)
