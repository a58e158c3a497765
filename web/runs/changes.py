"""Notification of all pages that runs have changed."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from web.live.events import EventHub


def tell_changed(hub: EventHub, run_ids: Iterable[str]) -> None:
    """Notify the pages, from any thread; they request again what they show."""
    hub.publish_from_thread({"type": "runs", "runs": list(run_ids)})
