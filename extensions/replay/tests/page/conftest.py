"""Pages in Chromium."""

from __future__ import annotations

from tests.web.browser.conftest import (
    blank_view,
    chromium,
    context,
    launch,
    look,
    look_at,
    profile,
    profiles,
    usual_port,
)

__all__ = [
    "blank_view",
    "chromium",
    "context",
    "launch",
    "look",
    "look_at",
    "profile",
    "profiles",
    "usual_port",
]
