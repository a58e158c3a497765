"""Gain path: check, coalesce, call the vehicle, publish to every page what was applied.

The vehicle is the authority. `ParameterWriter` carries changes to it: one call at a time for each
parameter and requester, at most 20 a second. The last value is always sent, however fast the slider
moved. Where one step in flight is not enough, `web.parameters.stepwise` makes several.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from quadrotor.errors import QuadlabError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.parameters.change import SIMULATOR, STATION, authority_of
from web.parameters.replica import PageParameters
from web.parameters.stepwise import step_towards, steps_between, walk

SHORTEST_PERIOD = 0.05  # s between two calls for one parameter

MOST_SLOTS = 1000

Applied = tuple[dict[str, ParameterValue], int]


class ParameterTarget(Protocol):
    """Target of changes: the station, for the vehicle."""

    async def change_parameters(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> Applied:
        """Change parameters; return the applied values and the revision.

        Raises RefusedError or LinkError.
        """
        ...


@dataclass(slots=True)
class _Slot:
    """Newest value that one requester set for one parameter, and the callers that wait."""

    value: ParameterValue = 0.0
    steps: int = 0  # that may still be made towards the value
    waiting: list[asyncio.Future[tuple[ParameterValue, int]]] = field(default_factory=list)
    last_call: float = -math.inf
    task: asyncio.Task[None] | None = None


class ParameterWriter:
    """Changes of parameters through `target`, which keep `replica` up to date.

    Args:
        airborne: returns whether the vehicle flies, so that steps are limited.
    """

    def __init__(
        self,
        replica: PageParameters,
        target: ParameterTarget,
        airborne: Callable[[], bool] = lambda: False,
    ) -> None:
        self._replica = replica
        self._target = target
        self._airborne = airborne
        self._slots: dict[tuple[str, str], _Slot] = {}

    async def change(
        self, values: Mapping[str, object], requester: str, *, walks: bool = False
    ) -> Applied:
        """Change parameters; return the applied values and the revision.

        A single parameter may be coalesced with newer values of it from the same requester (the
        answer is then that of the newest). Several are one call, all or nothing.

        Args:
            walks: whether to reach a value in several steps if one is too large in flight.

        Raises ParameterError, RefusedError or LinkError.
        """
        checked = self._replica.check(values)
        walks = walks and self._airborne()
        if len(checked) != 1:
            if walks and steps_between(self._replica, checked) > 1:
                return await walk(self._replica, self._call, checked, requester, SHORTEST_PERIOD)
            return await self._call(checked, requester)
        ((name, value),) = checked.items()
        if len(self._slots) > MOST_SLOTS:  # drop those of people who have left
            self._slots = {k: s for k, s in self._slots.items() if s.task and not s.task.done()}
        slot = self._slots.setdefault((name, requester), _Slot())
        future = asyncio.get_running_loop().create_future()
        slot.value = value
        slot.steps = steps_between(self._replica, checked) if walks else 1
        slot.waiting.append(future)
        if slot.task is None or slot.task.done():
            slot.task = asyncio.create_task(self._drain(name, requester, slot))
        applied, revision = await future
        return {name: applied}, revision

    async def _drain(self, name: str, requester: str, slot: _Slot) -> None:
        """Send until no caller waits; of the values set in the meantime only the newest counts."""
        while slot.waiting:
            pause = slot.last_call + SHORTEST_PERIOD - time.monotonic()
            if pause > 0.0:
                await asyncio.sleep(pause)
            waiting, slot.waiting = slot.waiting, []
            slot.last_call = time.monotonic()
            wanted, value = slot.value, slot.value
            if slot.steps > 1:
                value = step_towards(self._replica, name, wanted)
            slot.steps -= 1
            try:
                applied, revision = await self._call({name: value}, requester)
            except QuadlabError as error:
                _answer_all(waiting, error)
                continue
            # Another requester may change it too: never make more steps than were planned.
            if value == wanted or slot.waiting or slot.steps < 1:
                _answer_all(waiting, (applied[name], revision))
            else:
                slot.waiting = waiting

    async def _call(self, values: Mapping[str, ParameterValue], requester: str) -> Applied:
        """Call the authorities, the simulator's last and separately.

        By then its change can fail only if the simulator does not answer.
        """
        simulated = {n: v for n, v in values.items() if authority_of(n) == SIMULATOR}
        if not simulated or len(simulated) == len(values):
            return await self._call_one(values, requester)
        others = {n: v for n, v in values.items() if n not in simulated}
        applied, revision = await self._call_one(others, requester)
        try:
            more, _ = await self._call_one(simulated, requester)
        except QuadlabError as error:
            raise type(error)(f"{error}; all but the simulator's values were applied") from error
        return {**applied, **more}, revision

    async def _call_one(self, values: Mapping[str, ParameterValue], requester: str) -> Applied:
        applied, revision = await self._target.change_parameters(values, requester)
        # A mixed call has the vehicle's revision; the station publishes changes of its own.
        mine = {n: v for n, v in applied.items() if authority_of(n) != STATION} or applied
        self._replica.confirm(mine, requester, revision)
        return applied, revision


def _answer_all(
    futures: Iterable[asyncio.Future[tuple[ParameterValue, int]]],
    answer: tuple[ParameterValue, int] | QuadlabError,
) -> None:
    for future in futures:
        if future.done():  # its page has left
            continue
        if isinstance(answer, QuadlabError):
            future.set_exception(answer)
        else:
            future.set_result(answer)
