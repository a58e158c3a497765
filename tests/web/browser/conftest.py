"""Chromium through Playwright, for the tests of the page. The 3D view is blanked in most."""

from __future__ import annotations

import io
import re
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.support.chromium import FLAGS

PLAIN = [*FLAGS, "--renderer-process-limit=1", "--disable-features=IsolateOrigins,site-per-process"]
"""Pages whose 3D view is blanked: a graphics card emulated for them takes most of a core. They
share a process: each would else start one of its own."""
WITH_WEBGL = [*PLAIN, "--enable-unsafe-swiftshader"]
"""The card is emulated for the 3D view alone; the page around it is put together without."""
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]
BY_COLOUR = ["color-contrast", "link-in-text-block"]
"""What another theme can change: the rest is looked at in one."""
BOUND = 20_000  # ms, for a broken page only
SCENE = (
    "<!doctype html><html lang=en><meta name=color-scheme content='light dark'>"
    "<title>3D view</title><body>"
)


class Look:
    """Looks for what a person would look for on the page; each method waits until it is so."""

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

    def value(self, selector: str, value: str | re.Pattern[str]) -> None:
        self._expect(self._page.locator(selector)).to_have_value(value, timeout=BOUND)


@pytest.fixture(scope="module")  # its event loop must not outlive the module: others run theirs
def chromium(request: pytest.FixtureRequest, chromium_path: str) -> Iterator[Any]:
    """A module that sets `NEEDS_WEBGL` gets a browser with it."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    flags = WITH_WEBGL if getattr(request.module, "NEEDS_WEBGL", False) else PLAIN
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path, args=flags)
        yield browser
        browser.close()


@pytest.fixture(scope="module", autouse=True)
def blank_view(request: pytest.FixtureRequest, serve: Any) -> Iterator[None]:
    """An empty document in place of the 3D view."""
    if not getattr(request.module, "NEEDS_WEBGL", False):
        serve.view = SCENE
    yield
    serve.view = None


@pytest.fixture
def flying(site: Any, station: Any) -> Iterator[Callable[[bool], None]]:
    """A vehicle that publishes at 10 Hz; call with False to silence it."""
    going, talking = threading.Event(), threading.Event()
    going.set()
    talking.set()

    def fly() -> None:
        while going.is_set():
            if talking.is_set():
                station.fly()
            threading.Event().wait(0.1)

    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    yield lambda on: talking.set() if on else talking.clear()
    going.clear()
    thread.join()


@pytest.fixture(scope="module")
def profile(chromium: Any) -> Iterator[Any]:
    """Keeps the page's files, as a browser that has been here does."""
    made = chromium.new_context(viewport={"width": 1440, "height": 900})
    made.set_default_timeout(BOUND)
    yield made
    made.close()


@pytest.fixture(scope="module")
def forget(profile: Any) -> Callable[[], None]:
    """`forget()` closes the profile's pages and clears what they kept, files apart. The blank page
    that this needs stays: each new one costs a process."""
    blank = profile.new_page()
    devtools = profile.new_cdp_session(blank)

    def clear() -> None:
        origins = set()
        for page in profile.pages:
            if page is not blank:
                origins.add("{0.scheme}://{0.netloc}".format(urlsplit(page.url)))
                page.close()
        profile.clear_cookies()
        profile.clear_permissions()
        for origin in origins:
            devtools.send(
                "Storage.clearDataForOrigin", {"origin": origin, "storageTypes": "local_storage"}
            )

    return clear


@pytest.fixture
def context(profile: Any, forget: Callable[[], None]) -> Iterator[Any]:
    """Yield a context for a test's pages: signed in nowhere, with nothing kept but files."""
    yield profile
    forget()


@pytest.fixture
def open_page(context: Any) -> Iterator[Callable[[Any], Any]]:
    """`open_page(site)` signs in; an error in a page's scripts fails the test."""
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


@pytest.fixture
def look(page: Any) -> Look:
    return Look(page)


@pytest.fixture
def look_at() -> type[Look]:
    return Look


@pytest.fixture(scope="module")
def lab_of_pages(helper: Any) -> Any:
    """The module page_lab.py beside this."""
    return helper("browser/page_lab")


@pytest.fixture(scope="module")
def flying_lab(
    tmp_path_factory: pytest.TempPathFactory, serve: Any, helper: Any, lab_of_pages: Any
) -> Iterator[Any]:
    """A site in flight, with runs, a history of gains and an account: what pages can show."""
    data = tmp_path_factory.mktemp("pages")
    vehicle, calibrating = helper("step_vehicle"), helper("calibrating")
    with lab_of_pages.flying_lab(data, serve, vehicle, calibrating) as site:
        yield site


@pytest.fixture(scope="module")
def axe() -> Callable[..., list[str]]:
    """`axe(page)`: the serious and critical violations axe-core finds, one line each. The 3D view
    is viser's page, and left out."""
    package = pytest.importorskip("axe_playwright_python", reason="axe-core is not installed")
    script = (Path(package.__file__).parent / "axe.min.js").read_text()

    def violations(page: Any, rules: Sequence[str] = RULES) -> list[str]:
        if not page.evaluate("'axe' in window"):
            page.evaluate(script)
        found = page.evaluate(
            """(tags) => axe.run({ exclude: ["#scene"] },
            { runOnly: tags, resultTypes: ["violations"], iframes: false })""",
            list(rules),
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
def axe_in_both_themes(axe: Callable[..., list[str]]) -> Callable[[Any], list[str]]:
    """`axe` in the light theme and, where colours count, in the dark one, in which the page is
    left.
    """

    def violations(page: Any) -> list[str]:
        found = []
        for scheme, rules in (("light", RULES), ("dark", BY_COLOUR)):
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")  # no half way
            found += [f"{scheme}: {line}" for line in axe(page, rules)]
        return found

    return violations


@pytest.fixture(scope="session")
def keep_picture() -> Callable[..., None]:
    """`keep_picture(page, path, of)`: a PNG of at most 256 colours, the rare ones true; of the
    whole page or of one element."""

    def keep(page: Any, path: Path, of: str = "") -> None:
        from PIL import Image

        taken = page.locator(of).screenshot() if of else page.screenshot()
        shot = Image.open(io.BytesIO(taken)).convert("RGB")
        most, plain = Image.Quantize.MAXCOVERAGE, Image.Dither.NONE
        shot.quantize(256, method=most, kmeans=3, dither=plain).save(path, optimize=True)

    return keep


@pytest.fixture(scope="session")
def crooked() -> Callable[[Any], list[str]]:
    """`crooked(page)`: what does not fit its window, one line each."""
    script = Path(__file__).with_name("crooked.js").read_text()
    return lambda page: list(page.evaluate(script))
