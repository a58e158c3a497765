"""Replica of the parameters of vehicle, station and simulator that all pages show.

A page gets each value with the revision at which its authority applied it, and like the replica
never replaces a newer one by an older, so that all screens end on the same value.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any

from quadrotor.errors import LinkError, UnknownParameterError
from quadrotor.parameter_description import ParameterDescription, ParameterValue, coerce
from vehicle_link.clock import wall_time
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.replica import ParameterReplica, Snapshot
from web.live.events import parameter_change

LAYOUT = "station.bearings.layout"

Message = dict[str, Any]


class PageParameters(ParameterReplica):
    """Replica with descriptions, which publishes news to pages; only the event loop writes.

    Attributes:
        generation: increases when revisions may be those of other processes than before (another
            vehicle, a restart), also across restarts of this process. Revisions of different
            generations are not compared.
    """

    def __init__(self, publish: Callable[[Message], None]) -> None:
        super().__init__()
        self._publish = publish
        self._descriptions: dict[str, ParameterDescription] = {}
        self.generation = 0

    def load(
        self,
        values: Mapping[str, ParameterValue],
        revision: int,
        instance: int = 0,
        since: int | None = None,
        descriptions: Iterable[ParameterDescription] = (),
    ) -> Snapshot:
        """Apply a snapshot as the replica does, and notify pages to read it."""
        self._descriptions = {d.name: d for d in descriptions}
        if not self.is_whole or instance != self.instance:
            self.generation = max(self.generation + 1, time.time_ns() // 1_000_000)
        snapshot = super().load(values, revision, instance, since)
        self._publish({"type": "parameters", "revision": self.revision})
        return snapshot

    def confirm(self, values: Mapping[str, ParameterValue], requester: str, revision: int) -> None:
        """Apply the values of an answer, and publish the new ones to every page."""
        before = {name: self.value(name) for name in values}
        self._publish_news(self.apply(values, revision), before, requester, revision)

    def note_change(self, change: ParameterChange) -> None:
        """Apply the message of an authority, as `confirm` does."""
        news = self.apply({change.name: change.new}, change.revision, change.instance)
        self._publish_news(news, {change.name: change.old}, change.requester, change.revision)

    def _publish_news(
        self,
        news: Mapping[str, ParameterValue],
        before: Mapping[str, ParameterValue | None],
        requester: str,
        revision: int,
    ) -> None:
        for name, value in news.items():
            change = parameter_change(name, before[name], value, requester, wall_time())
            self._publish({**change, "revision": revision, "generation": self.generation})

    def check(self, values: Mapping[str, object]) -> dict[str, ParameterValue]:
        """Return the values, checked and converted to their types.

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

    def description(self, name: str) -> ParameterDescription | None:
        return self._descriptions.get(name)

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return tuple(self._descriptions.values())

    def as_json(self) -> Message:
        return {
            "revision": self.revision,
            "generation": self.generation,
            "parameters": [
                {**asdict(d), "value": self.value(name), "revision": self.revision_of(name)}
                for name, d in self._descriptions.items()
            ],
        }
