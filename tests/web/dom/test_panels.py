"""Panels of extensions on the console: a bad one says so in its place, and all else works."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from quadrotor.extension import PagePanel
from tests.web.conftest import serving
from web import assembly
from web.panels import Panel

SCRIPTS = {
    "good": """import { element } from "/static/core/dom.js";
export function show(place, { session }) { place.append(element("p", {}, session.vehicle)); }
""",
    "late": "export function show() { throw new Error('no wind'); }\n",
    "early": "throw new Error('nothing runs');\nexport function show() {}\n",
}


@pytest.fixture(scope="module")
def panel_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    data, folder = tmp_path_factory.mktemp("data"), tmp_path_factory.mktemp("page")
    for name, text in SCRIPTS.items():
        (folder / f"{name}.js").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assembly, "panels_of_extensions", lambda: panels(folder))
        with serving(data, Catalogue(data)) as running:
            yield running


def panels(folder: Path) -> Iterator[Panel]:
    for name in SCRIPTS:
        offer = PagePanel(name=name, target=f"page/{name}.js:show", place="tabs", title=name)
        yield Panel(offer, "tunnel", folder)


def test_a_panel_shows_the_parts_of_the_page_and_a_bad_one_says_why(
    context: Any, panel_site: Any, look_at: Any
) -> None:
    page, failed = context.new_page(), list[str]()
    page.on("pageerror", lambda error: failed.append(str(error)))
    page.goto(f"{panel_site.base}/?token={panel_site.token}")
    page.wait_for_selector("#behaviors button")
    look = look_at(page)
    page.click("[data-tab=good]")
    look.text("#tab-good", "^quad1$")
    page.click("[data-tab=late]")
    look.text("#tab-late [role=alert]", "^The extension tunnel cannot show this: no wind$")
    page.click("[data-tab=early]")
    look.text("#tab-early [role=alert]", "tunnel cannot show this: its script did not run$")
    assert failed == ["nothing runs"]
