"""Beacons dragged in the 3D view: each step requests a new layout on the gain path.

A drag produces up to ten positions a second. A step changes the layout last requested, not the one
last confirmed, so that two beacons can be moved at once. The gain path sends only the newest.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from bearing_sim.beacons import format_layout, parse_layout
from quadrotor.errors import LinkError, QuadlabError
from web.live.events import EventHub
from web.parameters.replica import LAYOUT, PageParameters
from web.parameters.writer import ParameterWriter

Position = tuple[float, float, float]
DIGITS = 4  # to a tenth of a millimetre, well within the flatness a small set needs
PAUSE = 1.0  # s between two event lines about refusals


class BeaconMoves:
    """Requests of layouts in which a beacon was moved.

    Args:
        put_back: called after each refusal, to show the confirmed layout again.
    """

    def __init__(
        self,
        gains: ParameterWriter,
        replica: PageParameters,
        hub: EventHub,
        put_back: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._gains, self._replica, self._hub = gains, replica, hub
        self._put_back = put_back
        self._clock = clock
        self._tasks: set[asyncio.Task[None]] = set()
        self._wanted: str | None = None
        self._reported = float("-inf")

    @property
    def busy(self) -> bool:
        """Return whether a step is still unanswered."""
        return bool(self._tasks)

    def moved(self, id: int, position_w: Position, who: str) -> None:
        """Move beacon `id` to `position_w` (m); to be called on the event loop."""
        text = self._wanted or self._replica.value(LAYOUT)
        try:
            if not isinstance(text, str):
                raise LinkError("the layout has not been read yet")
            place = [round(float(x), DIGITS) for x in position_w]
            wanted = format_layout(parse_layout(text).moved(id, place))
        except QuadlabError as error:
            self._refused(id, who, error)
            return
        self._wanted = wanted
        task = asyncio.get_running_loop().create_task(self._change(id, wanted, who))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _change(self, id: int, text: str, who: str) -> None:
        try:
            await self._gains.change({LAYOUT: text}, who)
        except QuadlabError as error:
            self._refused(id, who, error)
        finally:
            if self._wanted == text:
                self._wanted = None  # from now on the confirmed layout counts

    def _refused(self, id: int, who: str, error: QuadlabError) -> None:
        self._wanted = None
        self._put_back()
        if self._clock() - self._reported >= PAUSE:
            self._reported = self._clock()
            self._hub.say("warn", f"beacon {id} not moved ({who}): {error}")
