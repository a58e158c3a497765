"""Pages of the web process in node, on the DOM of jsdom: for tests that need no browser.

The page's own scripts run against the real server. There is no layout, no drawing, no pointer and
no second window; what needs one of them raises `DomError`, or has no method here. The methods are
named and wait as those of Playwright's sync API, so that a test reads the same with either.
"""

from __future__ import annotations

import json
import queue
import re
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import translate
from pathlib import Path
from typing import Any

DRIVER = Path(__file__).parents[1] / "web" / "dom" / "driver.js"
BOUND = 5_000
"""Longest wait in a page, in ms, which only a broken page needs."""
LATE = 60.0
"""Longest wait for node itself, in s."""
Selector = str | dict[str, str]
"""Playwright's selector; as {"only": selector} it may find only one element."""
Pattern = str | re.Pattern[str]


class DomError(AssertionError):
    """Error of a page, or of a test that asks for what only a browser has."""


class DomBrowser:
    """One node process, which holds the pages of all tests of a process."""

    def __init__(self, node: str) -> None:
        self._process = subprocess.Popen(
            [node, DRIVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._count = 0
        self._pages: dict[int, DomPage] = {}
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def ask(self, on: int | None, call: str, *args: Any) -> Any:
        """Return what node answers. Raises DomError."""
        assert self._process.stdin is not None
        self._count += 1
        request = {"id": self._count, "on": on, "call": call, "args": args}
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        while True:
            answer = self._next()
            if answer.get("id") == self._count:
                break
        if "error" in answer:
            raise DomError(answer["error"])
        return answer["value"]

    def _next(self) -> dict[str, Any]:
        """Return the next line; what happened in a page is passed on to it."""
        try:
            line = self._lines.get(timeout=LATE)
        except queue.Empty:
            raise DomError(f"node did not answer for {LATE:.0f} s") from None
        if not line:
            raise DomError(f"node ended with {self._process.wait(LATE)}; see its words above")
        said: dict[str, Any] = json.loads(line)
        if "event" in said and said["page"] in self._pages:
            self._pages[said["page"]].happened(said)
        return said

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Read lines until the condition holds."""
        while not condition():
            try:
                self._next()
            except DomError as error:
                raise DomError(f"waited for {what} in vain: {error}") from None

    def new_context(self) -> DomContext:
        return DomContext(self)

    def open(self, page: DomPage) -> None:
        self._pages[page.id] = page

    def close(self) -> None:
        """End node; it must end well."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        assert self._process.wait(LATE) == 0


class DomContext:
    """Cookies and stored values of one person's browser, and its pages."""

    def __init__(self, browser: DomBrowser) -> None:
        self.browser = browser
        self._id = browser.ask(None, "newContext")
        self.pages: list[DomPage] = []
        self.problems: list[PageError] = []
        """Errors of scripts that no listener of a page has heard."""

    def new_page(self) -> DomPage:
        page = DomPage(self, self.browser.ask(None, "newPage", self._id))
        self.pages.append(page)
        self.browser.open(page)
        return page

    def add_cookies(self, cookies: list[dict[str, str]]) -> None:
        self.browser.ask(None, "addCookies", self._id, cookies)

    def clear_cookies(self) -> None:
        self.browser.ask(None, "clearCookies", self._id)

    def close(self) -> None:
        for page in list(self.pages):
            page.close()
        self.browser.ask(None, "closeContext", self._id)
        if self.problems:
            raise DomError("\n".join(f"{one}\n{one.stack}" for one in self.problems))


@dataclass(frozen=True)
class DomRequest:
    """Request or answer that a page's script has made or had."""

    url: str
    method: str
    status: int = 0


@dataclass(frozen=True)
class PageError:
    """Error that no script of a page has caught."""

    text: str
    stack: str

    def __str__(self) -> str:
        return self.text


class DomPage:
    """Page with the part of Playwright's sync API that needs no browser."""

    def __init__(self, context: DomContext, number: int) -> None:
        self.context, self.id = context, number
        self._listeners: list[tuple[str, Callable[[Any], None]]] = []

    def _ask(self, call: str, *args: Any) -> Any:
        return self.context.browser.ask(self.id, call, *args)

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
        self.context.browser.wait(lambda: bool(seen), f"an answer of {address}")
        self._listeners.remove(own)

    def goto(self, url: str) -> DomRequest:
        return DomRequest(url, "GET", self._ask("goto", url))

    def reload(self) -> None:
        self._ask("reload")

    def close(self) -> None:
        self.context.browser.ask(None, "closePage", self.id)
        self.context.pages.remove(self)

    @property
    def url(self) -> str:
        return str(self._ask("url"))

    def title(self) -> str:
        return str(self._ask("title"))

    def locator(self, selector: str) -> DomLocator:
        return DomLocator(self, selector)

    def wait_for_selector(
        self, selector: Selector, state: str = "visible", timeout: float = BOUND
    ) -> None:
        self._ask("waitFor", selector, state, timeout)

    def wait_for_url(self, pattern: str) -> None:
        self._ask("waitForUrl", translate(pattern), BOUND)

    def evaluate(self, script: str, argument: Any = None) -> Any:
        return self._ask("evaluate", script, argument)

    def eval_on_selector(self, selector: Selector, script: str, argument: Any = None) -> Any:
        return self._ask("evaluateOn", selector, script, False, argument)

    def eval_on_selector_all(self, selector: Selector, script: str, argument: Any = None) -> Any:
        return self._ask("evaluateOn", selector, script, True, argument)

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
    """What a selector finds in a page, looked up at each use."""

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

    @property
    def first(self) -> DomLocator:
        return self.nth(0)

    @property
    def last(self) -> DomLocator:
        return self.nth(-1)

    def all(self) -> list[DomLocator]:
        return [self.nth(index) for index in range(self.count())]

    def count(self) -> int:
        return int(self._page._ask("count", self._selector))

    def all_inner_texts(self) -> list[str]:
        return list(self._page._ask("innerTexts", self._selector))

    def evaluate(self, script: str, argument: Any = None) -> Any:
        return self._page.eval_on_selector({"only": self._selector}, script, argument)

    def evaluate_all(self, script: str, argument: Any = None) -> Any:
        return self._page.eval_on_selector_all(self._selector, script, argument)


OF_LOCATORS = frozenset(
    "click dblclick fill press focus check uncheck select_option set_input_files inner_text "
    "text_content input_value get_attribute is_enabled is_disabled is_checked is_visible "
    "is_hidden".split()
)


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

    def value(self, selector: str, value: Pattern) -> None:
        self._page.expect(selector, "value", value)
