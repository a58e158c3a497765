"""Pages without a browser, for tests of the page that need no layout, pointer, drawing or window.

The fixtures have the names of those in tests/web/browser, and the tests read the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.web.dom.dom_driver import DomDriver
from tests.web.dom.dom_look import DomLook
from tests.web.dom.dom_page import DomContext, DomPage


@pytest.fixture(scope="session")
def dom(node_path: str) -> Iterator[DomDriver]:
    """Yield the node process that all modules of a process share."""
    driver = DomDriver(node_path)
    yield driver
    driver.close()


@pytest.fixture
def context(dom: DomDriver) -> Iterator[DomContext]:
    """Yield a context for a test's pages: signed out, with nothing stored."""
    made = DomContext(dom)
    yield made
    made.close()


@pytest.fixture(scope="module")
def kept_context(dom: DomDriver) -> Iterator[DomContext]:
    """Yield the same for pages that the tests of a module share."""
    made = DomContext(dom)
    yield made
    made.close()


@pytest.fixture
def open_page(context: DomContext) -> Iterator[Callable[[Any], DomPage]]:
    """Yield `open_page(site)`, which signs in; an error in a page's scripts fails the test."""
    problems: list[str] = []

    def open_at(site: Any) -> DomPage:
        page = context.new_page()
        page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
        page.goto(f"{site.base}/?token={site.token}")
        page.wait_for_selector("#behaviors button")
        return page

    yield open_at
    assert problems == []


@pytest.fixture
def page(open_page: Callable[[Any], DomPage], site: Any, flying: Any) -> DomPage:
    return open_page(site)


@pytest.fixture(scope="module")
def kept_page(kept_context: DomContext, site: Any) -> Iterator[DomPage]:
    """Yield one signed-in page for all tests of a module that need no fresh one."""
    problems: list[str] = []
    made = kept_context.new_page()
    made.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    made.goto(f"{site.base}/?token={site.token}")
    made.wait_for_selector("#behaviors button")
    yield made
    assert problems == []


@pytest.fixture
def look(page: DomPage) -> DomLook:
    return DomLook(page)


@pytest.fixture
def look_at() -> type[DomLook]:
    return DomLook
