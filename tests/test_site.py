"""The documentation site: what its pages are made of, without building it (`scripts/site` does)."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any, cast

import pytest
from mkdocs.exceptions import PluginError

from extensions.documents import diagrams
from quadlab.commands.table import commands as known_commands
from quadrotor.checkout import ROOT
from scripts.docs import hooks, reference
from vehicle_link.topics.table import TOPICS


def page(uri: str) -> Any:
    return SimpleNamespace(file=SimpleNamespace(src_uri=uri))


def test_a_link_out_of_docs_leads_to_the_page_of_that_file() -> None:
    text = (
        "[a](../../examples/live_client.py) [b](../runs.md#api) [c](../decisions) [d](https://e.f)"
    )
    assert hooks.on_page_markdown(
        text, page("extending/notebooks.md"), cast(Any, None), cast(Any, None)
    ) == (
        "[a](../repository/examples/live_client.py.md) [b](../runs.md#api) "
        "[c](../decisions/README.md) [d](https://e.f)"
    )
    back = hooks.on_page_markdown(
        "[a](../docs/runs.md)",
        page("repository/firmware/README.md"),
        cast(Any, None),
        cast(Any, None),
    )
    assert back == "[a](../../runs.md)"


@pytest.mark.parametrize(
    "html",
    ['<script src="https://elsewhere/a.js">', '<link rel="stylesheet" href="http://a/b.css">'],
)
def test_a_page_that_would_load_from_elsewhere_is_refused(html: str) -> None:
    with pytest.raises(PluginError, match="would load"):
        hooks.on_post_page(html, page("a.md"), cast(Any, None))
    assert hooks.on_post_page('<a href="https://a">', page("a.md"), cast(Any, None))


def test_a_table_that_stayed_text_is_refused() -> None:
    with pytest.raises(PluginError, match="an empty line is missing"):
        hooks.on_page_content("<p>| a | b |</p>", page("a.md"), cast(Any, None), cast(Any, None))


def test_the_reference_has_every_command_topic_and_definition() -> None:
    commands = re.findall(r"^## quadlab (\w+)$", reference.command_line(), re.MULTILINE)
    assert commands == list(known_commands())
    topics = reference.topics()
    assert all(f"\n| `{name}` | " in topics for name in TOPICS)
    for anchor in re.findall(r"\]\(#(\w+)\)", topics):
        assert re.search(rf"^### {anchor}$", topics, re.MULTILINE | re.IGNORECASE), anchor
    assert "| `pose.pose.position.x` | m |" in reference.file_format()


def test_the_reference_of_routes_has_their_least_roles() -> None:
    routes = reference.http_routes()
    for route, role in (
        ("GET /api/summary", "viewer"),
        ("PUT /api/beacons", "operator"),
        ("GET /api/users", "admin"),
    ):
        assert f"### `{route}`\n\nLeast role: {role}." in routes, route


def test_every_document_is_in_the_navigation() -> None:
    """mkdocs says so as well; here it costs nothing."""
    navigation = (ROOT / "mkdocs.yml").read_text()
    for document in (ROOT / "docs").rglob("*.md"):
        name = document.relative_to(ROOT / "docs").as_posix()
        assert f": {name}" in navigation or name.startswith("decisions/0"), name


def test_every_flow_chart_is_drawn_with_its_boxes_and_arrows() -> None:
    charts = [
        text
        for document in (ROOT / "docs").rglob("*.md")
        for text in re.findall(r"^```mermaid\n(.*?)^```", document.read_text(), re.M | re.S)
    ]
    assert len(charts) >= 4
    for text in charts:
        drawn = diagrams.svg(text)
        assert drawn.count('class="arrow"') == text.count("-->")
        boxes = re.findall(r'\["?([^"\]]+)"?\]', text)
        assert drawn.count('class="box"') >= len(boxes)
        for lane in re.findall(r"subgraph (\w+)", text):
            assert f">{lane}</text>" in drawn


def test_a_flow_chart_that_is_not_understood_is_refused() -> None:
    with pytest.raises(ValueError, match="no arrow at"):
        diagrams.svg("flowchart LR\n  a ==> b")
