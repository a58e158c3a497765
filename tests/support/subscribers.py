"""The wait for a topic's first subscriber."""

from __future__ import annotations

import threading
import time

from vehicle_link.transport.publisher import Publisher


def has_subscriber(publisher: Publisher, patience: float) -> bool:
    """Wait for a subscriber for at most `patience` seconds; return whether there is one."""
    deadline = time.monotonic() + patience
    while not publisher.has_subscribers and time.monotonic() < deadline:
        threading.Event().wait(0.01)
    return publisher.has_subscribers
