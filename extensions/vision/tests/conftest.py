"""Fixtures of the page, for tests of the calibration."""

from __future__ import annotations

from tests.web.conftest import until

__all__ = ["until"]
