"""Chromium through Playwright, for the tests of the page. Most have a blank 3D view."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.support.chromium import FLAGS
from tests.waiting import LIMIT
from web.live.sockets import listen
from web.process import url_of

PLAIN = [*FLAGS, "--renderer-process-limit=1", "--disable-features=IsolateOrigins,site-per-process"]
"""Flags for pages whose 3D view is blank: a graphics card emulated for them takes most of a core.

The pages share a process; otherwise each would start one.
"""
WITH_WEBGL = [*PLAIN, "--enable-unsafe-swiftshader"]
"""Flags that emulate the card for the 3D view alone; the page is composed without it."""
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]
BY_COLOUR = ["color-contrast", "link-in-text-block"]
"""Checks that depend on the theme; the others run in only one."""
BOUND = 60_000  # ms, for a broken page only
REACTION = 10.0  # s, after which a person lets go and presses again
SCENE = (
    "<!doctype html><html lang=en><meta name=color-scheme content='light dark'>"
    "<title>3D view</title><body>"
)


class Look:
    """Checks of the page as a person sees it; each method waits until its condition holds."""

    def __init__(self, page: Any) -> None:
        from playwright.sync_api import expect

        self._page = page
        self._expect = expect

    def text(self, selector: str, pattern: str) -> None:
        self._expect(self._page.locator(selector)).to_have_text(re.compile(pattern), timeout=BOUND)

    def has_class(self, selector: str, name: str) -> None:
        expected = re.compile(rf"\b({name})\b")
        self._expect(self._page.locator(selector)).to_have_class(expected, timeout=BOUND)

    def has_no_class(self, selector: str, name: str) -> None:
        expected = re.compile(rf"\b({name})\b")
        self._expect(self._page.locator(selector)).not_to_have_class(expected, timeout=BOUND)

    def hold(self, selector: str, done: Callable[[], bool]) -> None:
        """Hold a button until something is done, and anew if it let go by itself.

        A button of a page that was slow may have been disabled at the press, or have moved.
        """
        page, bound = self._page, time.monotonic() + LIMIT
        page.locator(selector).scroll_into_view_if_needed()
        while not done():
            assert time.monotonic() < bound, f"{selector}: held {LIMIT:.0f} s in vain"
            page.hover(selector)
            page.mouse.down()
            patience = time.monotonic() + REACTION
            while not done() and time.monotonic() < patience:
                page.wait_for_timeout(20)
                if page.locator(f"{selector}.holding").count():
                    patience = time.monotonic() + REACTION
            page.mouse.up()

    def value(self, selector: str, value: str | re.Pattern[str]) -> None:
        self._expect(self._page.locator(selector)).to_have_value(value, timeout=BOUND)


@pytest.fixture(scope="session")
def launch(chromium_path: str) -> Iterator[Callable[[list[str]], Any]]:
    """Yield `launch(flags)`, which returns the browser of these flags.

    All modules of a process share it and its driver, because both take 1 s of processor time to
    start. Their event loop is the running one from then on.
    """
    from playwright.sync_api import sync_playwright

    running: dict[str, Any] = {}
    with sync_playwright() as playwright:
        loop = asyncio.get_running_loop()

        def find(flags: list[str]) -> Any:
            asyncio._set_running_loop(loop)
            key = " ".join(flags)
            if key not in running or not running[key].is_connected():
                launched = playwright.chromium.launch(executable_path=chromium_path, args=flags)
                running[key] = launched
            return running[key]

        yield find
        asyncio._set_running_loop(loop)


class Profile:
    """A browser profile as that of a returning user: it caches the page's files."""

    def __init__(self, browser: Any, address: str) -> None:
        self.context = browser.new_context(viewport={"width": 1440, "height": 900})
        self.context.set_default_timeout(BOUND)
        self.context.set_default_navigation_timeout(BOUND)
        self._address = address
        self._blank = self.context.new_page()
        self._devtools = self.context.new_cdp_session(self._blank)

    def forget(self) -> None:
        """Close the pages and clear all that they stored except files.

        The blank page that this needs stays, because each new one costs a process.
        """
        origins = {self._address}
        for page in self.context.pages:
            if page is not self._blank:
                origins.add("{0.scheme}://{0.netloc}".format(urlsplit(page.url)))
                page.close()
        self.context.unroute_all()
        self.context.clear_cookies()
        self.context.clear_permissions()
        for origin in origins:
            self._devtools.send(
                "Storage.clearDataForOrigin", {"origin": origin, "storageTypes": "local_storage"}
            )


@pytest.fixture(scope="session")
def usual_port() -> int:
    """Return a port for all sites of a process, one after another.

    What a profile caches belongs to an address.
    """
    with listen("127.0.0.1", 0) as listener:
        port: int = listener.getsockname()[1]
    return port


@pytest.fixture(scope="session")
def profiles() -> dict[tuple[Any, str], Profile]:
    """Return the profiles that all modules of a process share, by browser and name."""
    return {}


@pytest.fixture(scope="module")
def chromium(
    request: pytest.FixtureRequest,
    launch: Callable[[list[str]], Any],
    profiles: dict[tuple[Any, str], Profile],
) -> Iterator[Any]:
    """Yield a browser, with WebGL for a module that sets `NEEDS_WEBGL`.

    A context that a module makes of it is closed with the module.
    """
    browser = launch(WITH_WEBGL if getattr(request.module, "NEEDS_WEBGL", False) else PLAIN)
    yield browser
    shared = [profile.context for profile in profiles.values()]
    for context in browser.contexts:
        if context not in shared:
            context.close()
    asyncio._set_running_loop(None)  # other tests run loops of their own in this thread


@pytest.fixture(scope="module")
def profile(
    chromium: Any, profiles: dict[tuple[Any, str], Profile], usual_port: int
) -> Callable[[str], Profile]:
    """Return `profile(name)`, a profile of the module's browser."""

    def find(name: str) -> Profile:
        key = chromium, name
        if key not in profiles:
            profiles[key] = Profile(chromium, url_of("127.0.0.1", usual_port, has_tls=False))
        return profiles[key]

    return find


@pytest.fixture(scope="module", autouse=True)
def blank_view(request: pytest.FixtureRequest, serve: Any, usual_port: int) -> Iterator[None]:
    """Serve at the usual port, and an empty document in place of the 3D view."""
    serve.usual_port = usual_port
    if not getattr(request.module, "NEEDS_WEBGL", False):
        serve.view = SCENE
    yield
    serve.view, serve.usual_port = None, 0


@pytest.fixture
def context(request: pytest.FixtureRequest, profile: Callable[[str], Profile]) -> Iterator[Any]:
    """Yield a context for a test's pages: signed out, with nothing stored except files.

    A module that sets `PROFILE` to another name has another profile, without any files.
    """
    own = profile(getattr(request.module, "PROFILE", "test"))
    yield own.context
    own.forget()


@pytest.fixture(scope="module")
def kept_context(profile: Callable[[str], Profile]) -> Iterator[Any]:
    """Yield the same for pages that the tests of a module share."""
    own = profile("module")
    yield own.context
    own.forget()


@pytest.fixture
def open_page(context: Any) -> Iterator[Callable[[Any], Any]]:
    """Yield `open_page(site)`, which signs in; an error in a page's scripts fails the test."""
    problems: list[str] = []

    def open_at(site: Any) -> Any:
        page = context.new_page()
        page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
        page.goto(f"{site.base}/?token={site.token}")
        page.wait_for_selector("#behaviors button")
        return page

    yield open_at
    assert problems == []


@pytest.fixture
def page(open_page: Any, site: Any, flying: Any) -> Any:
    return open_page(site)


@pytest.fixture(scope="module")
def kept_page(kept_context: Any, site: Any) -> Iterator[Any]:
    """Yield one signed-in page for all tests of a module that need no fresh one."""
    problems: list[str] = []
    made = kept_context.new_page()
    made.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    made.goto(f"{site.base}/?token={site.token}")
    made.wait_for_selector("#behaviors button")
    yield made
    assert problems == []


@pytest.fixture
def look(page: Any) -> Look:
    return Look(page)


@pytest.fixture
def look_at() -> type[Look]:
    return Look


@pytest.fixture(scope="module")
def lab_of_pages(helper: Any) -> Any:
    """Return the module page_lab.py in this folder."""
    return helper("browser/page_lab")


@pytest.fixture(scope="module")
def flying_lab(
    tmp_path_factory: pytest.TempPathFactory, serve: Any, helper: Any, lab_of_pages: Any
) -> Iterator[Any]:
    """Yield a site in flight with runs, a history of gains and an account: all that pages show."""
    from extensions.tuning.tests import step_vehicle

    data = tmp_path_factory.mktemp("pages")
    with lab_of_pages.flying_lab(data, serve, step_vehicle, helper("calibrating")) as site:
        yield site


@pytest.fixture(scope="module")
def axe() -> Callable[..., list[str]]:
    """Return `axe(page)`: the serious and critical violations that axe-core finds, one line each.

    The 3D view is viser's page, and left out. `part` is a selector of what is checked alone.
    """
    import axe_playwright_python as package

    script = (Path(package.__file__).parent / "axe.min.js").read_text()

    def violations(page: Any, rules: Sequence[str] = RULES, part: str = "body") -> list[str]:
        if not page.evaluate("'axe' in window"):
            page.evaluate(script)
        found = page.evaluate(
            """([tags, part]) => axe.run(
            { exclude: ["#scene"], ...(part === "body" ? {} : { include: [part] }) },
            { runOnly: tags, resultTypes: ["violations"], iframes: false, preload: false })""",
            [list(rules), part],
        )
        return [
            f"{one['id']}: {' '.join(node['target'])} "
            f"{node['failureSummary'].splitlines()[-1].strip()}"
            for one in found["violations"]
            if one["impact"] in ("serious", "critical")
            for node in one["nodes"]
        ]

    return violations


@pytest.fixture(scope="module")
def axe_in_both_themes(axe: Callable[..., list[str]]) -> Callable[..., list[str]]:
    """Return `axe` in the light theme and, where colours matter, in the dark one.

    The page stays in the dark theme.
    """

    def violations(page: Any, part: str = "body") -> list[str]:
        found = []
        for scheme, rules in (("light", RULES), ("dark", BY_COLOUR)):
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")  # without transitions
            found += [f"{scheme}: {line}" for line in axe(page, rules, part)]
        return found

    return violations


@pytest.fixture(scope="session")
def crooked() -> Callable[[Any], list[str]]:
    """Return `crooked(page)`: the elements that do not fit their window, one line each."""
    script = Path(__file__).with_name("crooked.js").read_text()
    return lambda page: list(page.evaluate(script))
