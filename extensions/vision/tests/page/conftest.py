"""A browser, for the tests of the section *Camera*."""

from __future__ import annotations

from tests.web.browser.conftest import (
    axe,
    axe_in_both_themes,
    blank_view,
    chromium,
    context,
    crooked,
    launch,
    look_at,
    open_page,
    profile,
    profiles,
    usual_port,
)
from tests.web.conftest import serve

__all__ = [
    "axe",
    "axe_in_both_themes",
    "blank_view",
    "chromium",
    "context",
    "crooked",
    "launch",
    "look_at",
    "open_page",
    "profile",
    "profiles",
    "serve",
    "usual_port",
]
