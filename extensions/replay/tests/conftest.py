"""Sites of a scripted vehicle."""

from __future__ import annotations

from tests.web.conftest import serve, until

__all__ = ["serve", "until"]
