"""Files of the page from memory: a browser gets what the folder has."""

from __future__ import annotations

import asyncio
import contextvars
import os
import re
from pathlib import Path

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.routing import Mount

from quadrotor.checkout import ROOT
from web import static_files, theme, uplot
from web.static_files import CachedFiles


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "files" / "a.js"
    path.parent.mkdir()
    path.write_text("first")
    (tmp_path / "secret").write_text("not of the page")
    return path


class Asker:
    def __init__(self, folder: Path, files: CachedFiles | None = None) -> None:
        app = Starlette(routes=[Mount("/static", files or CachedFiles(folder))])
        self._transport = httpx.ASGITransport(app)

    def __call__(self, path: str, method: str = "GET", **headers: str) -> httpx.Response:
        async def ask() -> httpx.Response:
            async with httpx.AsyncClient(transport=self._transport, base_url="http://x") as client:
                named = {name.replace("_", "-"): value for name, value in headers.items()}
                return await client.request(method, f"/static/{path}", headers=named)

        return asyncio.run(ask())


@pytest.fixture
def ask(script: Path) -> Asker:
    return Asker(script.parent)


def test_a_file_comes_whole_with_its_type(ask: Asker) -> None:
    answer = ask("a.js")
    assert (answer.text, answer.headers["content-length"]) == ("first", "5")
    assert answer.headers["content-type"].startswith("text/javascript")
    assert ask("a.js", "HEAD").headers["content-length"] == "5"


def test_a_changed_file_is_read_again(ask: Asker, script: Path) -> None:
    before = ask("a.js").headers["etag"]
    assert ask("a.js", if_none_match=before).status_code == 304
    script.write_text("again")
    os.utime(script, ns=(1, 1))  # of the same size, but older
    after = ask("a.js", if_none_match=before)
    assert (after.status_code, after.text) == (200, "again")


def test_a_file_is_read_once(ask: Asker, script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ask("a.js")
    monkeypatch.setattr(static_files, "Path", None)
    assert ask("a.js").text == "first"


@pytest.mark.parametrize("path", ["none.js", "", "../secret", "%2e%2e/secret", "a%00b", "x" * 300])
def test_what_is_not_there_is_404(ask: Asker, path: str) -> None:
    assert ask(path).status_code == 404


def test_a_part_is_a_part_and_nothing_is_written(ask: Asker, script: Path) -> None:
    part = ask("a.js", range="bytes=1-2")
    assert (part.status_code, part.text) == (206, "ir")
    assert ask("a.js", "PUT").status_code == 405
    assert script.read_text() == "first"


def test_a_document_names_its_files_by_version_and_those_are_fetched_once(script: Path) -> None:
    files = CachedFiles(script.parent)
    (script.parent / "page.html").write_text('<script src="/static/a.js"></script>/static/a.js')
    ask = Asker(script.parent, files)

    def named() -> str:
        text = bytes(files.document("page.html").body).decode()
        (found,) = re.findall(r'"/static/(v-[0-9a-f]{16}/a\.js)"', text)
        assert text.endswith(">/static/a.js")
        return str(found)

    first = named()
    assert named() == first
    answer = ask(first)
    assert (answer.text, answer.headers["cache-control"]) == (
        "first",
        "private, max-age=31536000, immutable",
    )
    assert "cache-control" not in ask("a.js").headers
    script.write_text("again, and longer")
    second = named()
    assert second != first
    old, new = ask(first), ask(second)
    assert old.text == new.text == "again, and longer"
    assert "cache-control" not in old.headers, "a page of before asks again"
    assert "immutable" in new.headers["cache-control"]
    assert ask(second.replace("a.js", "none.js")).status_code == 404
    assert ask(second.replace("a.js", "%2e%2e/secret")).status_code == 404


@pytest.mark.parametrize(("cookie", "tag"), [("light", ' data-theme="light"'), ("<b>", "")])
def test_a_document_has_the_theme_that_its_browser_remembers(cookie: str, tag: str) -> None:
    def made() -> bytes:
        header = (b"cookie", f"quadlab_theme={cookie}".encode())
        theme.follow_choice(HTTPConnection({"type": "http", "headers": [header]}))
        return bytes(static_files.FILES.document("emergency/kill.html").body)

    assert f'<html lang="en"{tag} data-documents="'.encode() in contextvars.copy_context().run(made)


def test_a_joined_file_is_compressed_for_those_who_take_it_and_no_others(script: Path) -> None:
    script.write_text(f"/* {'a' * 5000} */")
    script.with_name("page.html").write_text('<script type="module" src="/static/a.js"></script>')
    ask = Asker(script.parent)
    plain = ask("joined/a.js", accept_encoding="identity")
    packed = ask("joined/a.js", accept_encoding="gzip, br")
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert plain.headers["vary"] == packed.headers["vary"] == "accept-encoding"
    assert int(packed.headers["content-length"]) < 500 < int(plain.headers["content-length"])
    assert packed.text == plain.text


def test_a_browser_keeps_uplot_under_its_version_and_gets_it_compressed() -> None:
    page = static_files.FILES.document("console/index.html").body
    named, version = re.findall(r'src="/vendor/(uPlot.iife.js)\?([^"]+)"', bytes(page).decode())[0]

    def ask(query: str, *headers: tuple[bytes, bytes]) -> httpx.Response:
        scope = {"type": "http", "query_string": query.encode(), "headers": headers, "path": "/"}
        given = uplot.answer(named, Request(scope))
        return httpx.Response(200, headers=given.headers.items(), content=bytes(given.body))

    whole, packed = ask("0"), ask(version, (b"accept-encoding", b"gzip, br"))
    assert packed.text == whole.text
    assert "uPlot" in whole.text
    assert int(packed.headers["content-length"]) < 0.5 * int(whole.headers["content-length"])
    assert "immutable" in packed.headers["cache-control"]
    assert "cache-control" not in whole.headers, "of another version"


@pytest.mark.parametrize(
    "path", [*ROOT.glob("web/static/*/*.html"), *ROOT.glob("extensions/*/page/*/*.html")], ids=str
)
def test_a_page_has_one_main_part_and_a_heading(path: Path) -> None:
    text = path.read_text()
    assert text.count("<main") == 1, "else a screen reader finds no way past the head"
    assert text.count("<h1") == (path.stem != "report"), "that of a report is its script's"
