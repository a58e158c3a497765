"""Pre-flight check list of the station, for the page."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from vehicle_link.checks import Check, from_messages
from web.live.latest import Live


def preflight_summary(live: Live) -> dict[str, Any] | None:
    """Return the pre-flight list, or None if the station has not sent it for a while."""
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
    """Return a check without its place, which is the same for all; it is sent twice a second."""
    fields = asdict(check)
    fields.pop("place")
    return fields
