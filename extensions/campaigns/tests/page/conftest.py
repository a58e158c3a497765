"""Pages in Chromium."""

from __future__ import annotations

from tests.web.browser.conftest import (
    blank_view,
    chromium,
    context,
    launch,
    open_page,
    profile,
    profiles,
    usual_port,
)
from tests.web.conftest import serve

__all__ = [
    "blank_view",
    "chromium",
    "context",
    "launch",
    "open_page",
    "profile",
    "profiles",
    "serve",
    "usual_port",
]
