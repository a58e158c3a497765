"""A mirror of the vehicle's and the station's parameters, in the order in which they applied it.

An answer to a change and the news of it come different ways and overtake each other. Each carries
the revision at which its authority applied it; an older one never replaces a newer one, here as
on every page, so that all screens end on the same value.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any

from quadrotor.errors import LinkError, UnknownParameterError
from quadrotor.parameters import ParameterDescription, ParameterValue, coerce
from vehicle_link.parameters.authority import VEHICLE, authority_of
from vehicle_link.parameters.messages import AppliedChange

LAYOUT = "station.bearings.layout"

Message = dict[str, Any]


class ParameterMirror:
    """Only the event loop writes.

    Attributes:
        revision: the vehicle's.
        generation: grows when all is read again (another vehicle, a restart): revisions of
            different generations are not compared. Also across restarts of this process.
        clock: counts what was taken over.
    """

    def __init__(self, publish: Callable[[Message], None]) -> None:
        self._publish = publish
        self._descriptions: dict[str, ParameterDescription] = {}
        self._values: dict[str, ParameterValue] = {}
        self._revisions: dict[str, int] = {}
        self._taken: dict[str, int] = {}  # at which `clock`
        self._instances: dict[str, int] = {}  # by authority, whose revisions are kept
        self.revision = -1
        self.generation = 0
        self.clock = 0

    def load(
        self,
        descriptions: Iterable[ParameterDescription],
        values: Mapping[str, ParameterValue],
        revision: int,
        since: int | None = None,
    ) -> None:
        """Take over all values; pages are notified to read them again.

        Args:
            revision: the vehicle's, that these values have at least.
            since: `clock` when reading began: what came meanwhile is newer and stays. None when
                vehicle or station may be others than before.
        """
        newer: dict[str, ParameterValue] = {}
        if since is None:
            self.generation = max(self.generation + 1, time.time_ns() // 1_000_000)
            self._revisions, self.revision = {}, revision
            self._instances = {}
        else:
            newer = {n: v for n, v in self._values.items() if self._taken.get(n, -1) > since}
            self.revision = max(self.revision, revision)
        self._descriptions = {d.name: d for d in descriptions}
        self._values = {**values, **{n: v for n, v in newer.items() if n in values}}
        for name in values:
            if name not in newer and authority_of(name) == VEHICLE:
                self._revisions[name] = max(self._revisions.get(name, -1), revision)
        self._publish({"type": "parameters", "revision": self.revision})

    def apply(self, values: Mapping[str, ParameterValue], requester: str, revision: int) -> None:
        """Take over confirmed values and send every page those that are news.

        Args:
            revision: of their authority; values that are newer than that stay.
        """
        self.clock += 1
        for name, value in values.items():
            if revision < self._revisions.get(name, -1):
                continue
            self._revisions[name], self._taken[name] = revision, self.clock
            if self._values.get(name) == value:
                continue
            self._values[name] = value
            self._publish(
                {
                    "type": "parameter",
                    "name": name,
                    "value": value,
                    "requester": requester,
                    "revision": revision,
                    "generation": self.generation,
                }
            )
        if any(authority_of(name) == VEHICLE for name in values):
            self.revision = max(self.revision, revision)

    def told(self, change: AppliedChange) -> None:
        """Apply a message of an authority; another process of it counts its revisions anew."""
        authority = authority_of(change.name)
        if self._instances.setdefault(authority, change.instance) != change.instance:
            self._instances[authority] = change.instance
            self._revisions = {
                n: r for n, r in self._revisions.items() if authority_of(n) != authority
            }
        self.apply({change.name: change.new}, change.requester, change.revision)

    def check(self, values: Mapping[str, object]) -> dict[str, ParameterValue]:
        """Return all of them as they may be sent: a slider ends at its bounds, a typed value is
        refused.

        Raises UnknownParameterError, WrongTypeError, OutOfBoundsError or LinkError.
        """
        if not self._descriptions:
            raise LinkError(
                "the vehicle's parameters have not been read yet; is the vehicle connected?"
            )
        for name in values:
            if name not in self._descriptions:
                raise UnknownParameterError(f"unknown parameter {name!r}; the Gains tab lists all")
        return {name: coerce(self._descriptions[name], value) for name, value in values.items()}

    def value(self, name: str) -> ParameterValue | None:
        return self._values.get(name)

    def values(self) -> dict[str, ParameterValue]:
        return dict(self._values)

    def revision_of(self, name: str) -> int:
        """Return the revision at which `name` was applied, -1 when that is not known."""
        return self._revisions.get(name, -1)

    def description(self, name: str) -> ParameterDescription | None:
        return self._descriptions.get(name)

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return tuple(self._descriptions.values())

    def as_json(self) -> Message:
        return {
            "revision": self.revision,
            "generation": self.generation,
            "parameters": [
                {
                    **asdict(d),
                    "value": self._values.get(name),
                    "revision": self._revisions.get(name, -1),
                }
                for name, d in self._descriptions.items()
            ],
        }
