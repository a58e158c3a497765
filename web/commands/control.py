"""Control as the page shows it: the station's lease, and the people present to hold it.

The station decides (console/commands). Once a second this process reports to it who has a page
open, so that control does not stay with someone who left.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from typing import Literal

from fastapi import FastAPI, HTTPException

from web.access.requester import Operator
from web.access.roles import Role
from web.commands.bodies import CommandBody
from web.latest import Live
from web.live.station import Station

PERIOD = 1.0  # s


class Control:
    """Control of one vehicle.

    Args:
        present: returns the labels of those who have a page open.
        tell: called with these labels, to report them to the station.
    """

    def __init__(
        self,
        live: Live,
        present: Callable[[], Iterable[str]],
        tell: Callable[[Iterable[str]], None],
    ) -> None:
        self._live = live
        self._present = present
        self._tell = tell

    @property
    def holder(self) -> str:
        """Return the label of the person who has control; "" = no one, or not known."""
        status = self._live.current("control")
        return str(status.holder) if status is not None else ""

    def may(self, label: str) -> bool:
        """Return whether this person has control or could take it by a command."""
        return self.holder in ("", label)

    def summary(self) -> dict[str, object] | None:
        """Return who has control, for the page; None while the station does not report it."""
        status = self._live.current("control")
        if status is None:
            return None
        return {
            "holder": status.holder,
            "asking": status.asking,
            "answer_within": round(float(status.answer_within)),
        }

    async def run(self) -> None:
        while True:
            self._tell(sorted(self._present()))
            await asyncio.sleep(PERIOD)


class ControlBody(CommandBody):
    """Change of control; the action `take` is for admins."""

    action: Literal["ask", "give", "keep", "release", "take"]


def add_control(app: FastAPI, station: Station) -> None:
    """Add POST /api/control. The station refuses, with the reason, orders that this person may not
    give.
    """

    @app.post("/api/control")
    async def control(body: ControlBody, session: Operator) -> dict[str, bool]:
        """Ask for control, answer a request for it, or give it up; an admin may take it."""
        if body.action == "take" and not session.role.may(Role.ADMIN):
            raise HTTPException(
                403, f"{session.label} may ask for control; admins alone may take it"
            )
        await station.command("control", session.label, **body.fields)
        return {"accepted": True}
