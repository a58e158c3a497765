"""Changes larger than one step in flight: several changes, each within the vehicle's limit.

All values move together on the straight line between the two sets, so that every intermediate set
lies between them in each gain. Values without a step limit change with the first step, where a
refusal changes nothing.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping

from quadrotor.errors import LinkError, QuadlabError, RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.parameters.steps import step_towards as one_step
from web.parameters.replica import PageParameters

ROUNDING = 1e-9

Values = Mapping[str, ParameterValue]
Call = Callable[[Values, str], Awaitable[tuple[dict[str, ParameterValue], int]]]


def steps_between(replica: PageParameters, values: Values) -> int:
    """Return the number of steps from the present values to these in flight; at least 1."""
    counts = [1]
    for name, value in values.items():
        step, present = _step(replica, name), replica.value(name)
        if step is not None and present is not None:
            distance = abs(float(value) - float(present))
            counts.append(math.ceil(distance / step * (1.0 - ROUNDING)))
    return max(counts)


def step_towards(replica: PageParameters, name: str, value: ParameterValue) -> ParameterValue:
    """Return the value, or the farthest value that one step in flight reaches."""
    step, present = _step(replica, name), replica.value(name)
    return value if present is None else one_step(step, present, value)


async def walk(
    replica: PageParameters, call: Call, values: Values, requester: str, pause: float
) -> tuple[dict[str, ParameterValue], int]:
    """Change values step by step; return the values applied in the end, and their revision.

    When a step is refused, the steps before are undone in reverse order.

    Raises the QuadlabError of the refused step, with where the values are.
    """
    start = {name: present for name in values if (present := replica.value(name)) is not None}
    count = steps_between(replica, values)
    limited = {n for n in start if _step(replica, n) is not None and start[n] != values[n]}

    def at(k: int) -> dict[str, ParameterValue]:
        share = k / count
        between = {
            name: float(start[name]) + share * (float(values[name]) - float(start[name]))
            for name in limited
        }
        return {**between} if 0 < k < count else {n: (values if k else start)[n] for n in limited}

    applied, revision = await call(
        {**{n: v for n, v in values.items() if n not in limited}, **at(1)}, requester
    )
    for k in range(2, count + 1):
        await asyncio.sleep(pause)
        try:
            more, revision = await call(at(k), requester)
        except QuadlabError as error:
            await _back(
                call, at, start, reached=k - 1, requester=requester, pause=pause, error=error
            )
            raise
        applied = {**applied, **more}
    return applied, revision


async def _back(
    call: Call,
    at: Callable[[int], dict[str, ParameterValue]],
    start: Values,
    reached: int,
    requester: str,
    pause: float,
    error: QuadlabError,
) -> None:
    """Return to the start, and raise the error with where the values are now."""
    try:
        for k in range(reached - 1, -1, -1):
            await asyncio.sleep(pause)
            await call(at(k) if k else dict(start), requester)
    except QuadlabError:
        kind = LinkError if isinstance(error, LinkError) else RefusedError
        raise kind(
            f"{error}; {reached} steps were made and could not be taken back: see the history"
        ) from error
    raise type(error)(f"{error}; all values are as before") from error


def _step(replica: PageParameters, name: str) -> float | None:
    description = replica.description(name)
    return None if description is None else description.flight_step
