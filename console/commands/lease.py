"""The control lease: one operator commands at a time, and everyone sees who.

The first person who commands while the lease is free gets it. The holder hands it over on request,
releases it, or loses it by leaving the page; an admin may take it. When the holder neither answers
a request nor does anything else, the requester gets it in the end: a page left open must not keep a
laboratory waiting, and hands on the sticks must not lose them.
"""

from __future__ import annotations

from dataclasses import dataclass

from quadrotor.errors import RefusedError

ABSENT = 5.0
"""Seconds after which a holder is considered absent whose page is closed and who commands nothing.
"""
UNANSWERED = 20.0
"""Seconds without an answer to a request, and without any action since, after which the holder
loses the lease."""


@dataclass(frozen=True, slots=True)
class LeaseView:
    """The state of the lease, with names as in `requester` everywhere; "" = no one."""

    holder: str
    asking: str
    answer_within: float
    """Seconds after which the requester gets control if the holder stays inactive; 0 = no request.
    """


class ControlLease:
    """The state machine of the lease. Times in s of any steady clock. Not thread-safe."""

    def __init__(self) -> None:
        self.holder = ""
        self._seen = self._acted = 0.0
        self._asking = ""
        self._asked = 0.0

    def view(self, now: float) -> LeaseView:
        left = UNANSWERED - self._waited(now) if self._asking else 0.0
        return LeaseView(self.holder, self._asking, max(left, 0.0))

    def may_command(self, who: str, now: float) -> bool:
        """Return whether `command` would allow this requester."""
        self.expire(now)
        return self.holder in ("", who)

    def command(self, who: str, now: float) -> None:
        """Count a command of this person. Raises RefusedError when another holds the lease."""
        if not self.may_command(who, now):
            raise RefusedError(
                f"{self.holder} has control; request it, or wait until it is released"
            )
        if not self.holder:
            self._give(who, now)
        self._seen = self._acted = now

    def present(self, who: str, now: float) -> None:
        """Note that this person has a page open."""
        if who == self.holder:
            self._seen = now
        self.expire(now)

    def ask(self, who: str, now: float) -> None:
        """Request control; it is given at once when it is free. Raises RefusedError while another
        person requests it.
        """
        self.expire(now)
        if self.holder in ("", who):
            self._give(who, now)
        elif self._asking not in ("", who):
            raise RefusedError(f"{self._asking} has already requested control from {self.holder}")
        elif not self._asking:
            self._asking, self._asked = who, now

    def answer(self, who: str, yes: bool, now: float) -> None:
        """Answer the pending request, as the holder. Raises RefusedError."""
        self._of_holder(who)
        if not self._asking:
            raise RefusedError("there is no pending request for control")
        self._acted = now
        if yes:
            self._give(self._asking, now)
        else:
            self._asking = ""

    def release(self, who: str, now: float) -> None:
        """Release the lease as its holder; a pending request gets it. Raises RefusedError."""
        self._of_holder(who)
        self._free(now)

    def take(self, who: str, now: float) -> None:
        """Give the lease to an admin, no matter who holds it."""
        self._give(who, now)

    def expire(self, now: float) -> None:
        """Take the lease from an absent or silent holder; call some times a second."""
        if not self.holder:
            return
        unanswered = self._asking and self._waited(now) > UNANSWERED
        if now - self._seen > ABSENT or unanswered:
            self._free(now)

    def _waited(self, now: float) -> float:
        return now - max(self._asked, self._acted)

    def _of_holder(self, who: str) -> None:
        if who != self.holder:
            raise RefusedError(f"you do not have control: {self.holder or 'no one'} has it")

    def _free(self, now: float) -> None:
        following, self.holder = self._asking, ""
        if following:
            self._give(following, now)

    def _give(self, who: str, now: float) -> None:
        self.holder, self._asking = who, ""
        self._seen = self._acted = now
