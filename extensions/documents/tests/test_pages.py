"""The documents as pages: every link leads somewhere, and the index names each heading."""

from __future__ import annotations

import posixpath
import re
from typing import Any

import pytest

from extensions.documents.rendering import DOCS, headings, paths, read, slug
from extensions.documents.routes import TABS

LINK = re.compile(r'(?:href|src)="(?!\w+:)([^"#]*)#?([^"]*)"')


@pytest.fixture(scope="module")
def anchors() -> dict[str, set[str]]:
    return {path: {one.anchor for one in headings(path)} for path in paths()}


@pytest.mark.parametrize("path", paths())
def test_every_link_leads_to_a_page_a_picture_or_a_heading(
    path: str, anchors: dict[str, set[str]]
) -> None:
    document = read(path)
    assert document.headings == tuple(headings(path))
    assert not re.search(r'<style|<[^>]*\sstyle="', document.body), "the page's policy drops styles"
    for link, anchor in LINK.findall(document.body):
        target = posixpath.normpath(posixpath.join(posixpath.dirname(path), link)) if link else path
        source = re.sub(r"\.html$", ".md", target)
        assert (DOCS / source).is_file(), link
        assert not anchor or anchor in anchors[source], (link, anchor)


def test_a_link_to_code_names_its_file_and_a_flow_chart_is_drawn() -> None:
    assert '<span class="file" title="firmware/README.md of quadlab">' in (
        read("boards/microcontroller.md").body
    )
    body = read("architecture.md").body
    assert '<figure class="chart"><svg' in body
    assert "flowchart" not in body


def test_anchors_are_those_of_git_hosts() -> None:
    assert slug("From `a` to B: 1.5° (of `x_y`)") == "from-a-to-b-15-of-x_y"


def test_the_page_serves_documents_pictures_and_index_and_nothing_else(site: Any) -> None:
    client = site.sign_in()
    for address in ("/documents", "/documents/"):
        home = client.get(address, follow_redirects=True)
        assert (home.status_code, home.url.path) == (200, "/documents/index.html")
    assert '<a href="architecture.html">Architecture</a>' in home.text
    assert client.get("/documents/images/fly.png").headers["content-type"] == "image/png"
    deep = client.get("/documents/boards/betaflight.html").text
    assert '<a href="../index.html">Documents</a>' in deep
    for path in ("safety.md", "nothing.html", "images/nothing.png", "..%2Fpyproject.toml"):
        assert client.get(f"/documents/{path}").status_code == 404
    index = client.get("/api/documents").json()
    [whole] = [one for one in index if one["address"] == "architecture.html"]
    assert (whole["title"], whole["heading"]) == ("Architecture", "")
    [tick] = [one for one in index if one["address"] == "architecture.html#one-tick"]
    assert "supervisor" in tick["words"].split()
    assert "quic" not in tick["words"].split(), "it is a word of another section"
    for tab, page in (*TABS.items(), ("tune", "tuning.html"), ("nothing", "index.html")):
        followed = client.get(f"/documents/of/{tab}", follow_redirects=True)
        assert (followed.status_code, followed.url.path) == (200, f"/documents/{page}")


def test_the_documents_are_searched_without_scripts(site: Any) -> None:
    client = site.sign_in()
    found = client.get("/documents/find", params={"words": "vicon Tracking"}).text
    assert '<li><a href="trackers.html">Tracking systems</a> </li>' in found
    assert found.index("trackers.html") < found.index("real_vehicle.html")
    nothing = client.get("/documents/find", params={"words": "<b>xyzzy</b>"}).text
    assert "No section has all of these words: &lt;b&gt;xyzzy&lt;/b&gt;." in nothing
    assert 'value="&lt;b&gt;xyzzy&lt;/b&gt;"' in nothing
    assert "none given" in client.get("/documents/find").text


def test_a_document_at_400_percent_does_not_scroll_sideways(chromium: Any, site: Any) -> None:
    page = chromium.new_context(viewport={"width": 320, "height": 256}).new_page()
    page.goto(f"{site.base}/?token={site.token}")
    for name in ("index", "importing", "safety", "how_to/troubleshooting"):
        page.goto(f"{site.base}/documents/{name}.html")
        assert page.locator("header input").bounding_box()["width"] > 80.0, name
        assert page.evaluate("document.documentElement.scrollWidth") == 320, name
