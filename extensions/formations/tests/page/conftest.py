"""Pages in Chromium."""

from __future__ import annotations

from tests.web.browser.conftest import blank_view, chromium, launch, look, profiles, usual_port

__all__ = ["blank_view", "chromium", "launch", "look", "profiles", "usual_port"]
