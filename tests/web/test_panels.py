"""Panels of extensions: in the page's documents, with files of their own; a bad one is left out."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from starlette.applications import Starlette
from starlette.routing import Mount

from quadrotor.extension import Extension, PageDocument, PagePanel
from quadrotor.extensions import Registry
from web import features
from web.panels import TABS, Document, Panel
from web.static_files import STATIC, CachedFiles

PAGE = {
    "console/panels.js": "export function addPanel() {}\n",
    "core/dom.js": "export const $ = 1, element = 2;\nexport const unused = 3;\n",
    "page/page.js": 'import { $ } from "../core/dom.js";\nimport "../console/panels.js";\n$;\n',
    "page/page.html": """<!doctype html>
<html lang="en">
<head>
<link rel="stylesheet" href="/static/page/page.css">
<script type="module" src="/static/page/page.js"></script>
</head>
<nav>
  <!-- tabs -->
</nav>
<!-- place: tabs -->
<!-- place: setup -->
<input id="search">
</html>
""",
    "page/page.css": "a { b: c }\n",
}
OURS = {
    "wind.js": """import { element } from "/static/core/dom.js";
import { speed } from "./speed.js";
export function show(place) { place.append(element(speed)); }
""",
    "speed.js": "export const speed = 3;\n",
    "wind.css": "#tab-wind { d: e }\n",
}
OFFER: dict[str, Any] = {
    "name": "wind",
    "target": "page/wind.js:show",
    "place": "tabs",
    "title": "Wind & gusts",
    "styles": ("wind.css",),
}


def written(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.fixture
def made(tmp_path: Path) -> Callable[..., CachedFiles]:
    """Return a function that makes the files of a page with one panel of the extension tunnel."""

    def make(ours: dict[str, str] = OURS, **changed: Any) -> CachedFiles:
        page = written(tmp_path / "static", PAGE)
        offer = PagePanel(**{**OFFER, **changed})
        return CachedFiles(page, [Panel(offer, "tunnel", written(tmp_path / "ours", ours))])

    return make


def document(files: CachedFiles) -> str:
    return bytes(files.document("page/page.html").body).decode()


def fetched(files: CachedFiles, path: str) -> httpx.Response:
    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(Starlette(routes=[Mount("/static", files)]))
        async with httpx.AsyncClient(transport=transport, base_url="http://x") as client:
            return await client.get(f"/static/{path}")

    return asyncio.run(ask())


def test_a_tab_has_its_button_and_element_and_its_files_below_its_extensions_name(
    made: Callable[..., CachedFiles],
) -> None:
    files = made(after="gains", icon="M1 2")
    text = document(files)
    assert files.problems == []
    assert re.findall(r'data-tab="(\w+)"', text) == [
        *("fly", "experiments", "gains", "wind", "beacons", "calibrate", "link")
    ]
    assert text.count('aria-selected="true"') == 1
    assert 'tabindex="-1" data-icon="M1 2"><span>Wind &amp; gusts</span></button>' in text
    assert 'id="tab-wind" role="tabpanel"' in text
    script = r'src="/static/(v-[0-9a-f]{16}/joined/extensions/tunnel/wind\.js)"></script>\n</head>'
    (address,) = re.findall(script, text)
    assert fetched(files, address).status_code == 200
    assert "immutable" in fetched(files, address).headers["cache-control"]
    assert fetched(files, "extensions/tunnel/speed.js").text == OURS["speed.js"]
    assert fetched(files, "joined/page/page.css").text.endswith(OURS["wind.css"])
    assert fetched(files, f"{address}.map").json()["sources"][0].endswith("tunnel/speed.js")


def test_a_section_stands_in_its_place(made: Callable[..., CachedFiles]) -> None:
    text = document(made(place="setup"))
    assert re.findall(r'data-tab="(\w+)"', text) == list(TABS)
    assert '<section id="wind" aria-label="Wind &amp; gusts" data-panel="wind"' in text


def test_a_panels_script_uses_the_modules_of_the_page_and_runs_its_own(
    made: Callable[..., CachedFiles],
) -> None:
    files = made()
    page = fetched(files, "joined/page/page.js").text
    ours = fetched(files, "joined/extensions/tunnel/wind.js").text
    shared = '{ "console/panels.js": $$console$panels, "core/dom.js": $$core$dom };\n'
    assert f"globalThis.$$shared = {shared}// ---- page/page.js" in page
    assert "return { $, element };" in page
    assert 'const $$core$dom = globalThis.$$shared["core/dom.js"];' in ours
    assert re.findall(r"^// ---- (\S+)$", ours, re.MULTILINE) == [
        *("extensions/tunnel/speed.js", "extensions/tunnel/wind.js")
    ]
    assert '\n$$console$panels.addPanel("wind", show);\n' in ours


def two_panels(tmp_path: Path, **second: Any) -> CachedFiles:
    """Return the files of a page with two panels that one module shows."""
    page, ours = written(tmp_path / "static", PAGE), written(tmp_path / "ours", OURS)
    offers = PagePanel(**OFFER), PagePanel(**{**OFFER, "name": "gusts", **second})
    return CachedFiles(page, [Panel(one, "tunnel", ours) for one in offers])


def test_one_module_shows_several_panels_and_runs_once(tmp_path: Path) -> None:
    files = two_panels(tmp_path, target="page/wind.js:gusts", place="setup")
    (tmp_path / "ours" / "wind.js").write_text(OURS["wind.js"] + "export function gusts() {}\n")
    text = document(files)
    assert files.problems == []
    assert text.count("joined/extensions/tunnel/wind.js") == 1
    script = fetched(files, "joined/extensions/tunnel/wind.js").text
    assert script.count("// ---- extensions/tunnel/wind.js") == 1
    assert re.findall(r"addPanel\((.*)\);", script) == ['"wind", show', '"gusts", gusts']


def test_a_module_that_shows_panels_of_two_pages_is_told(tmp_path: Path) -> None:
    files = two_panels(tmp_path, place="attic")
    other = (
        PAGE["page/page.html"].replace("page/page.js", "page/other.js").replace("setup", "attic")
    )
    other = other.replace("  <!-- tabs -->\n", "").replace("<!-- place: tabs -->\n", "")
    written(tmp_path / "static", {"page/other.html": other, "page/other.js": PAGE["page/page.js"]})
    (line,) = files.problems
    assert "gusts is left out: extensions/tunnel/wind.js shows wind of another page, too" in line
    assert document(files).count("joined/extensions/tunnel/wind.js") == 1


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"target": "page/none.js:show"}, "there is no module extensions/tunnel/none.js"),
        ({"target": "page/wind.js:none"}, "wind.js, which does not export it"),
        ({"styles": ("none.css",)}, "there is no file .*ours/none.css"),
        ({"place": "cellar"}, "there is no place cellar; there are tabs, setup"),
        ({"name": "search"}, "a part of the page has this name; rename it"),
        ({"ours": {**OURS, "speed.js": "export default 3;"}}, "speed.js, line 1: export default 3"),
        ({"ours": {**OURS, "wind.css": "@import 'x';"}}, "wind.css, line 1: @import cannot be"),
        (
            {"ours": {"wind.js": 'import "/static/page/page.js";\nexport class show {}\n'}},
            "imports page/page.js, which the page runs itself",
        ),
    ],
)
def test_a_panel_that_cannot_be_shown_is_told_in_a_line_and_the_page_is_as_without(
    made: Callable[..., CachedFiles], changed: dict[str, Any], why: str
) -> None:
    files = made(**changed)
    (line,) = files.problems
    name = changed.get("name", "wind")
    assert line.startswith(f"extension tunnel: its panel of the page {name} is left out: ")
    assert re.search(why, line)
    text = document(files)
    assert re.findall(r'data-tab="(\w+)"', text) == list(TABS)
    assert "tunnel" not in text
    assert "$$shared" not in fetched(files, "joined/page/page.js").text


def test_a_folder_that_is_missing_is_told(tmp_path: Path) -> None:
    page = written(tmp_path / "static", PAGE)
    (line,) = CachedFiles(page, [Panel(PagePanel(**OFFER), "tunnel", tmp_path / "none")]).problems
    assert "left out: there is no module extensions/tunnel/wind.js" in line


@pytest.mark.parametrize("path", ["..%2f..%2fsecret", "..%2fsecret", "%2fetc%2fpasswd", "", "a"])
def test_nothing_outside_the_folder_of_a_panel_is_served(
    made: Callable[..., CachedFiles], tmp_path: Path, path: str
) -> None:
    files = made()
    (tmp_path / "secret").write_text("not of the page")
    assert fetched(files, f"extensions/tunnel/{path}").status_code == 404


def test_a_name_that_the_page_has_leaves_the_panel_out(monkeypatch: pytest.MonkeyPatch) -> None:
    offers = [PagePanel(**{**OFFER, "name": name}) for name in ("charts", "wind", "fly")]
    declared = Extension(name="tunnel", summary="", protocol=1, offers=tuple(offers))
    registry = Registry([("tunnel", "web", lambda: declared)])
    monkeypatch.setattr(features, "registry", lambda: registry)
    (panel,) = features.panels_of_extensions()
    assert (panel.offer.name, panel.extension) == ("wind", "tunnel")
    assert panel.folder == STATIC.parent / "page"
    assert [line.partition(" is left out")[0] for line in registry.problems] == [
        f"extension tunnel: its panel of the page {name}" for name in ("charts", "fly")
    ]


# ------------------------------------------------------------------ documents
def with_document(tmp_path: Path, files: dict[str, str]) -> CachedFiles:
    """Return the files of a page with one document of the extension tunnel."""
    page = written(tmp_path / "static", PAGE)
    offer = PageDocument(name="map", target="page/map/map.html", path="/{run_id}")
    return CachedFiles(page, (), [Document(offer, "tunnel", written(tmp_path / "ours", files))])


SHEET = '<link rel="stylesheet" href="/static/extensions/tunnel/map/map.css">\n'
SCRIPT = '<script type="module" src="/static/extensions/tunnel/map/map.js"></script>\n'
MAP = {
    "map/map.html": f'<!doctype html>\n<html lang="en">\n{SHEET}{SCRIPT}</html>\n',
    "map/map.css": "b { c: d }\n",
    "map/map.js": 'import { element } from "/static/core/dom.js";\nelement("map");\n',
}


def test_a_document_of_an_extension_has_its_address_and_its_joined_files(tmp_path: Path) -> None:
    files = with_document(tmp_path, MAP)
    assert (files.problems, files.documents) == (
        [],
        {"/map/{run_id}": "extensions/tunnel/map/map.html"},
    )
    text = bytes(files.document(files.documents["/map/{run_id}"]).body).decode()
    script, sheet = (re.findall(rf'{word}="/static/([^"]+)"', text)[0] for word in ("src", "href"))
    assert 'data-documents="map"' in text
    assert "element = 2" in fetched(files, script).text
    assert 'element("map")' in fetched(files, script).text
    assert "b { c: d }" in fetched(files, sheet).text


@pytest.mark.parametrize(
    ("lacking", "said"),
    [
        ("map/map.html", "map.html"),
        ("map/map.js", "there is no module extensions/tunnel/map/map.js"),
        ("map/map.css", "map.css"),
    ],
)
def test_a_document_without_one_of_its_files_is_left_out_and_told(
    tmp_path: Path, lacking: str, said: str
) -> None:
    files = with_document(tmp_path, {name: text for name, text in MAP.items() if name != lacking})
    assert files.documents == {}
    (line,) = files.problems
    assert "extension tunnel: its document of the page map is left out: " in line
    assert said in line
    assert "page.js" in document(files), "the page itself is as without"
    assert 'data-documents=""' in document(files), "no link leads to it"
