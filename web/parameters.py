"""The gain path: check, coalesce, ask the vehicle, tell every page what was applied.

The vehicle is the authority. `ParameterMirror` holds what it said last; `GainPath` carries
changes to it: one call at a time for each parameter, at most 20 a second, and the last value
is always sent, however fast the slider moved.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

from quadrotor.errors import LinkError, QuadlabError, UnknownParameterError
from quadrotor.parameters import ParameterDescription, ParameterValue, coerce

SHORTEST_PERIOD = 0.05  # s between two calls for one parameter

STATION_PREFIX = "station."
LAYOUT = "station.bearings.layout"

Message = dict[str, Any]


class ParameterTarget(Protocol):
    """Who applies changes: the station, for the vehicle."""

    async def change_parameters(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """Applied values and revision. Raises RefusedError or LinkError."""
        ...


class ParameterMirror:
    """What vehicle and station last said of their parameters; `revision` is the vehicle's."""

    def __init__(self, publish: Callable[[Message], None]) -> None:
        self._publish = publish
        self._descriptions: dict[str, ParameterDescription] = {}
        self._values: dict[str, ParameterValue] = {}
        self.revision = -1

    def load(
        self,
        descriptions: Iterable[ParameterDescription],
        values: Mapping[str, ParameterValue],
        revision: int,
    ) -> None:
        """Replaces everything; pages are told to read it again."""
        self._descriptions = {d.name: d for d in descriptions}
        self._values = dict(values)
        self.revision = revision
        self._publish({"type": "parameters", "revision": revision})

    def apply(self, values: Mapping[str, ParameterValue], requester: str, revision: int) -> None:
        """Takes over confirmed values and tells every page of those that are news."""
        news = {n: v for n, v in values.items() if self._values.get(n) != v}
        self._values.update(news)
        if not all(name.startswith(STATION_PREFIX) for name in values):  # it counts its own
            self.revision = max(self.revision, revision)
        for name, value in news.items():
            self._publish({
                "type": "parameter", "name": name, "value": value,
                "requester": requester, "revision": revision,
            })  # fmt: skip

    def check(self, values: Mapping[str, object]) -> dict[str, ParameterValue]:
        """All of them as they may be sent: a slider ends at its bounds, a typed value is refused.

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

    def description(self, name: str) -> ParameterDescription | None:
        return self._descriptions.get(name)

    def as_json(self) -> Message:
        return {
            "revision": self.revision,
            "parameters": [
                {**asdict(d), "value": self._values.get(name)}
                for name, d in self._descriptions.items()
            ],
        }


@dataclass(slots=True)
class _Slot:
    """The newest wish for one parameter and who waits for its answer."""

    value: ParameterValue = 0.0
    requester: str = ""
    waiting: list[asyncio.Future[tuple[ParameterValue, int]]] = field(default_factory=list)
    last_call: float = -math.inf
    task: asyncio.Task[None] | None = None


class GainPath:
    """Changes parameters through `target` and keeps `mirror` up to date."""

    def __init__(self, mirror: ParameterMirror, target: ParameterTarget) -> None:
        self._mirror = mirror
        self._target = target
        self._slots: dict[str, _Slot] = {}

    async def change(
        self, values: Mapping[str, object], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        """Applied values and revision.

        One parameter alone may be coalesced with newer values of it (the answer is then the
        newer one's); several are one call, all or nothing.
        Raises ParameterError, RefusedError or LinkError.
        """
        checked = self._mirror.check(values)
        if len(checked) != 1:
            return await self._call(checked, requester)
        ((name, value),) = checked.items()
        slot = self._slots.setdefault(name, _Slot())
        future = asyncio.get_running_loop().create_future()
        slot.value, slot.requester = value, requester
        slot.waiting.append(future)
        if slot.task is None or slot.task.done():
            slot.task = asyncio.create_task(self._drain(name, slot))
        applied, revision = await future
        return {name: applied}, revision

    async def _drain(self, name: str, slot: _Slot) -> None:
        """Sends until nobody waits: values that came meanwhile count only by the newest."""
        while slot.waiting:
            pause = slot.last_call + SHORTEST_PERIOD - time.monotonic()
            if pause > 0.0:
                await asyncio.sleep(pause)
            waiting, slot.waiting = slot.waiting, []
            slot.last_call = time.monotonic()
            try:
                applied, revision = await self._call({name: slot.value}, slot.requester)
            except QuadlabError as error:
                _answer_all(waiting, error)
            else:
                _answer_all(waiting, (applied[name], revision))

    async def _call(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> tuple[dict[str, ParameterValue], int]:
        applied, revision = await self._target.change_parameters(values, requester)
        self._mirror.apply(applied, requester, revision)
        return applied, revision


def _answer_all(
    futures: Iterable[asyncio.Future[tuple[ParameterValue, int]]],
    answer: tuple[ParameterValue, int] | QuadlabError,
) -> None:
    for future in futures:
        if future.done():  # its page went away
            continue
        if isinstance(answer, QuadlabError):
            future.set_exception(answer)
        else:
            future.set_result(answer)
