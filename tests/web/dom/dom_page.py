"""Page of the web process on the DOM of jsdom, with methods of Playwright's sync API.

The page's own scripts run against the real server. There is no layout, no drawing, no place of a
pointer and no second window; what needs one of them raises `DomError`, or has no method here. The
methods are named and wait as those of Playwright, so that a test reads the same with either.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fnmatch import translate
from pathlib import Path
from typing import Any

from tests.web.dom.dom_driver import DomDriver, DomError, DomRequest, PageError

BOUND = 60_000
"""Longest wait in a page, in ms, which only a broken page needs."""
Selector = str | dict[str, str]
"""Playwright's selector; as {"only": selector} it may find only one element."""


class DomContext:
    """Cookies and stored values of one person's browser, and its pages."""

    def __init__(self, driver: DomDriver) -> None:
        self.driver = driver
        self._id = driver.ask(None, "newContext")
        self.pages: list[DomPage] = []
        self.problems: list[PageError] = []
        """Errors of scripts that no listener of a page has heard."""

    def new_page(self) -> DomPage:
        page = DomPage(self, self.driver.ask(None, "newPage", self._id))
        self.pages.append(page)
        self.driver.listen(page.id, page.happened)
        return page

    def another(self) -> DomContext:
        """Return a context of somebody else, who is signed out."""
        return DomContext(self.driver)

    def add_cookies(self, cookies: list[dict[str, str]]) -> None:
        self.driver.ask(None, "addCookies", self._id, cookies)

    def clear_cookies(self) -> None:
        self.driver.ask(None, "clearCookies", self._id)

    def close(self) -> None:
        for page in list(self.pages):
            page.close()
        self.driver.ask(None, "closeContext", self._id)
        if self.problems:
            raise DomError("\n".join(f"{one}\n{one.stack}" for one in self.problems))


class DomPage:
    """Page with the part of Playwright's sync API that needs no browser."""

    def __init__(self, context: DomContext, number: int) -> None:
        self.context, self.id = context, number
        self._listeners: list[tuple[str, Callable[[Any], None]]] = []

    def _ask(self, call: str, *args: Any) -> Any:
        return self.context.driver.ask(self.id, call, *args)

    def on(self, event: str, listener: Callable[[Any], None]) -> None:
        """Call the listener with each `pageerror`, `request` or `response`."""
        if event not in ("pageerror", "request", "response"):
            raise DomError(f"the DOM page tells no {event}")
        self._listeners.append((event, listener))

    def happened(self, said: dict[str, Any]) -> None:
        """Take a line about what happened in this page."""
        kind = said["event"]
        fields = {k: v for k, v in said.items() if k not in ("event", "page")}
        told: Any = PageError(**fields) if kind == "pageerror" else DomRequest(**fields)
        listeners = [listener for event, listener in self._listeners if event == kind]
        if isinstance(told, PageError) and not listeners:
            self.context.problems.append(told)
        for listener in listeners:
            listener(told)

    @contextmanager
    def expect_response(self, address: str) -> Iterator[None]:
        """Wait for an answer from an address (with * and **) after what the block does."""
        wanted, seen = re.compile(translate(address)), []
        own = ("response", lambda one: seen.append(one) if wanted.match(one.url) else None)
        self._listeners.append(own)
        yield
        self.context.driver.wait(lambda: bool(seen), f"an answer of {address}")
        self._listeners.remove(own)

    def goto(self, url: str) -> DomRequest:
        return DomRequest(url, "GET", self._ask("goto", url))

    def reload(self) -> None:
        self._ask("reload")

    def close(self) -> None:
        self.context.driver.ask(None, "closePage", self.id)
        self.context.pages.remove(self)

    @property
    def url(self) -> str:
        return str(self._ask("url"))

    def locator(self, selector: str) -> DomLocator:
        return DomLocator(self, selector)

    def wait_for_selector(
        self, selector: Selector, state: str = "visible", timeout: float = BOUND
    ) -> None:
        self._ask("waitFor", selector, state, timeout)

    def evaluate(self, script: str, argument: Any = None) -> Any:
        return self._ask("evaluate", script, argument)

    def eval_on_selector(self, selector: Selector, script: str, argument: Any = None) -> Any:
        return self._ask("evaluateOn", selector, script, argument)

    def click(self, selector: Selector) -> None:
        self._ask("click", selector, BOUND)

    def dblclick(self, selector: Selector) -> None:
        self._ask("click", selector, BOUND, 2)

    def fill(self, selector: Selector, text: str) -> None:
        self._ask("fill", selector, text, BOUND)

    def type(self, selector: Selector, text: str) -> None:
        self.focus(selector)
        for key in text:
            self.keyboard.press(key)

    def press(self, selector: Selector, key: str) -> None:
        self.focus(selector)
        self.keyboard.press(key)

    def focus(self, selector: Selector) -> None:
        self._ask("focusOn", selector, BOUND)

    def check(self, selector: Selector) -> None:
        self._ask("check", selector, True, BOUND)

    def uncheck(self, selector: Selector) -> None:
        self._ask("check", selector, False, BOUND)

    def select_option(self, selector: Selector, wanted: str) -> None:
        self._ask("choose", selector, wanted, BOUND)

    def set_input_files(self, selector: Selector, file: Path) -> None:
        self._ask("setFile", selector, file.name, file.read_text(), BOUND)

    def hover(self, selector: Selector) -> None:
        """Rest the pointer on an element, so that it can be held there."""
        self._ask("hover", selector, BOUND)

    @property
    def mouse(self) -> DomMouse:
        return DomMouse(self)

    @property
    def keyboard(self) -> DomKeyboard:
        return DomKeyboard(self)

    def inner_text(self, selector: Selector) -> str:
        return str(self._ask("read", selector, "inner", "", BOUND))

    def text_content(self, selector: Selector) -> str:
        return str(self._ask("read", selector, "text", "", BOUND))

    def input_value(self, selector: Selector) -> str:
        return str(self._ask("read", selector, "value", "", BOUND))

    def get_attribute(self, selector: Selector, name: str) -> str | None:
        found: str | None = self._ask("read", selector, "attribute", name, BOUND)
        return found

    def is_enabled(self, selector: Selector) -> bool:
        return bool(self._ask("read", selector, "enabled", "", BOUND))

    def is_disabled(self, selector: Selector) -> bool:
        return not self.is_enabled(selector)

    def is_checked(self, selector: Selector) -> bool:
        return bool(self._ask("read", selector, "checked", "", BOUND))

    def is_visible(self, selector: Selector) -> bool:
        return bool(self._ask("visible", selector))

    def is_hidden(self, selector: Selector) -> bool:
        return not self.is_visible(selector)

    def expect(self, selector: str, kind: str, wanted: Any, is_not: bool = False) -> None:
        """Wait until text, class, value, count or enabled of what a selector finds is as wanted."""
        how: dict[str, Any] = {"isNot": is_not}
        if isinstance(wanted, re.Pattern):
            how["flags"] = "s" if wanted.flags & re.DOTALL else ""
            wanted = {"pattern": wanted.pattern}
        self._ask("expect", {"only": selector}, kind, wanted, how, BOUND)


class DomMouse:
    """Button of the pointer, on the element that `hover` named; there is no place to move it to."""

    def __init__(self, page: DomPage) -> None:
        self._page = page

    def down(self) -> None:
        self._page._ask("mouse", True)

    def up(self) -> None:
        self._page._ask("mouse", False)


class DomKeyboard:
    """Keys pressed in a page; they go to the element with the focus."""

    def __init__(self, page: DomPage) -> None:
        self._page = page

    def press(self, key: str) -> None:
        self._page._ask("press", key)

    def down(self, key: str) -> None:
        self._page._ask("keyDown", key)

    def up(self, key: str) -> None:
        self._page._ask("keyUp", key)


class DomLocator:
    """Elements that a selector finds in a page, looked up at each use."""

    def __init__(self, page: DomPage, selector: str) -> None:
        self._page, self._selector = page, selector

    def __getattr__(self, name: str) -> Any:
        """Return a method of the page that takes this selector."""
        if name not in OF_LOCATORS:
            raise DomError(f"the DOM page's locators have no {name}")
        method = getattr(self._page, name)
        return lambda *args: method({"only": self._selector}, *args)

    def locator(self, selector: str) -> DomLocator:
        return DomLocator(self._page, f"{self._selector} >> {selector}")

    def nth(self, index: int) -> DomLocator:
        return DomLocator(self._page, f"{self._selector} >> nth={index}")

    def count(self) -> int:
        return int(self._page._ask("count", self._selector))

    def evaluate(self, script: str, argument: Any = None) -> Any:
        return self._page.eval_on_selector({"only": self._selector}, script, argument)


OF_LOCATORS = frozenset(
    {
        "click",
        "dblclick",
        "fill",
        "press",
        "focus",
        "check",
        "uncheck",
        "select_option",
        "set_input_files",
        "inner_text",
        "text_content",
        "input_value",
        "get_attribute",
        "is_enabled",
        "is_disabled",
        "is_checked",
        "is_visible",
        "is_hidden",
    }
)
"""Methods of a page that take a selector first."""
