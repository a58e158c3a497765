"""The station's pre-flight check list, for the page."""

from __future__ import annotations

from typing import Any

from vehicle_link.checks import Check, from_messages
from web.live.latest import Live


def preflight_summary(live: Live) -> dict[str, Any] | None:
    """Return the pre-flight list; None when the station has not sent it for a while: then nothing
    is known.
    """
    message = live.current("preflight")
    if message is None:
        return None
    return {
        "ready": bool(message.ready),
        "armed": bool(message.armed),
        "blocks": bool(message.blocks),
        "checks": [_listed(one) for one in from_messages(message.checks)],
    }


def _listed(check: Check) -> dict[str, str]:
    """Return a check in a list that is the station's; sent twice a second."""
    fields = check_fields(check)
    fields.pop("place")
    return fields


def check_fields(check: Check) -> dict[str, str]:
    """Return a check as the page takes it."""
    return {
        "name": check.name,
        "place": check.place,
        "state": check.state,
        "found": check.found,
        "wanted": check.wanted,
        "advice": check.advice,
    }
