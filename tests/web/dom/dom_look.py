"""Checks of a page without a browser, as those of a page in Chromium."""

from __future__ import annotations

import re

from tests.web.dom.dom_page import DomPage


class DomLook:
    """Checks of the page as `Look` in tests/web/browser; each waits until its condition holds."""

    def __init__(self, page: DomPage) -> None:
        self._page = page

    def text(self, selector: str, pattern: str) -> None:
        self._page.expect(selector, "text", re.compile(pattern))

    def has_class(self, selector: str, name: str) -> None:
        self._page.expect(selector, "class", re.compile(rf"\b({name})\b"))

    def has_no_class(self, selector: str, name: str) -> None:
        self._page.expect(selector, "class", re.compile(rf"\b({name})\b"), is_not=True)

    def value(self, selector: str, value: str | re.Pattern[str]) -> None:
        self._page.expect(selector, "value", value)
