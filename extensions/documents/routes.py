"""Routes `/documents/…`: the documents as pages, with their pictures, and their index."""

from __future__ import annotations

import posixpath
from dataclasses import dataclass
from html import escape
from typing import Annotated

from fastapi import FastAPI, HTTPException, Query
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse, Response

from extensions.documents.rendering import (
    DOCS,
    HOME,
    Document,
    headings,
    paths,
    read,
    section_words,
)
from quadrotor.extension import PagePanel
from quadrotor.extensions import registry
from web.feature import Feature
from web.theme import html_tag
from web.vehicle_context import VehicleContext

PICTURES = {".png": "image/png", ".webp": "image/webp", ".svg": "image/svg+xml"}
LISTED = 40
"""Most sections that the search of the documents lists."""
TABS = {
    "fly": "tutorials/first_flight.html",
    "experiments": "experiments.html",
    "gains": "changing_parameters.html",
    "beacons": "beacons.html",
    "calibrate": "calibration.html",
    "link": "link.html",
    "charts": "page/charts.html",
}
"""The document of each built-in tab; an extension's declaration names that of its own."""
PAGE = """<!doctype html>
{tag}
<head>
<meta charset="utf-8">
<title>{title} · quadlab</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="/favicon.ico" type="image/svg+xml">
<link rel="stylesheet" href="/static/core/tokens.css">
<link rel="stylesheet" href="/static/extensions/documents/documents.css">
</head>
<body class="{kind}">
<header><a href="{top}../">quadlab</a><a href="{top}index.html">Documents</a>
<form action="{top}find" role="search"><input type="search" name="words" value="{words}"
placeholder="Search the documents" aria-label="search the documents" required></form></header>
<nav aria-label="this document">{contents}</nav>
<main>
{body}</main>
</body>
</html>
"""


@dataclass(frozen=True)
class Entry:
    """A section of a document, for the search: its heading, and all its words."""

    title: str
    heading: str
    address: str
    words: str


def add_documents(app: FastAPI, context: VehicleContext) -> None:
    @app.get("/api/documents")
    def index() -> list[Entry]:
        """Return the sections of all documents, with their addresses below `/documents/`."""
        return [entry for path in paths() for entry in _entries(path)]

    @app.get("/documents", include_in_schema=False)
    def home() -> Response:
        return RedirectResponse("documents/index.html")

    @app.get("/documents/of/{tab}", include_in_schema=False)
    def of_tab(tab: str) -> Response:
        return RedirectResponse(f"../{_of_tab(tab)}")

    @app.get("/documents/find", include_in_schema=False)
    def find(words: Annotated[str, Query(max_length=200)] = "") -> HTMLResponse:
        return HTMLResponse(_found(words))

    @app.get("/documents/{path:path}", include_in_schema=False)
    def document(path: str) -> Response:
        if not path:
            return RedirectResponse(_page_of(HOME))
        stem, kind = posixpath.splitext(path)
        if kind == ".html" and (source := f"{stem}.md") in paths():
            return HTMLResponse(_framed(source, read(source)))
        if kind in PICTURES and path in _pictures():
            return FileResponse(DOCS / path, media_type=PICTURES[kind])
        raise HTTPException(404, f"there is no document {path!r:.200}; /documents/ lists all")


FEATURE = Feature(add_documents)


def _pictures() -> set[str]:
    return {f.relative_to(DOCS).as_posix() for f in DOCS.rglob("*") if f.suffix in PICTURES}


def _of_tab(tab: str) -> str:
    """Return the page of a tab of the console, or the first page."""
    offered = registry().offers(PagePanel).get(tab)
    if offered is None or offered.extension is None or not offered.extension.docs:
        return TABS.get(tab, _page_of(HOME))
    return _page_of(offered.extension.docs)


def _page_of(path: str) -> str:
    return path.removesuffix(".md") + ".html"


def _entries(path: str) -> list[Entry]:
    found = headings(path)
    return [
        Entry(
            title=found[0].text,
            heading=one.text if k else "",
            address=_page_of(path) + (f"#{one.anchor}" if k else ""),
            words=words,
        )
        for k, (one, words) in enumerate(zip(found, section_words(path), strict=True))
    ]


def _found(words: str) -> str:
    """Return the page of the sections that have all words, those with them in the heading first."""
    wanted = words.lower().split()
    matching: list[tuple[int, Entry]] = []
    for entry in (one for path in paths() for one in _entries(path)):
        text = f"{entry.title} {entry.heading}".lower()
        if wanted and all(word in text or word in entry.words for word in wanted):
            matching.append((sum(word in text for word in wanted), entry))
    matching.sort(key=lambda pair: -pair[0])
    listed = "".join(
        f'<li><a href="{one.address}">{escape(one.title)}</a> {escape(one.heading)}</li>'
        for _, one in matching[:LISTED]
    )
    none = f"<p>No section has all of these words: {escape(words) or 'none given'}.</p>"
    return PAGE.format(
        tag=html_tag(),
        title="Search",
        top="",
        contents="",
        body=f"<h1>Search</h1>\n{f'<ul>{listed}</ul>' if listed else none}\n",
        kind="found",
        words=escape(words),
    )


def _framed(path: str, document: Document) -> str:
    """Return a document as a page, with relative addresses, as a proxy may be before it."""
    contents = "".join(
        f'<a href="#{one.anchor}" data-level="{one.level}">{escape(one.text)}</a>'
        for one in document.headings[1:]
        if one.level <= 3
    )
    return PAGE.format(
        tag=html_tag(),
        title=escape(document.title),
        top="../" * path.count("/"),
        contents=contents,
        body=document.body,
        kind="home" if path == HOME else "document",
        words="",
    )
