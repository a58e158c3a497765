"""The page's own files, served from memory, and only once to each browser.

Starlette passes each file to other threads, four times; while telemetry keeps the interpreter busy
each hop waits for its turn, and a page has about a hundred files. A document therefore names one
script and one stylesheet, joined from them (`web.joined_files`) and compressed, by the version of
their folders: what a browser has fetched under a version stays in its cache and is not requested
again. Panels of extensions (`web.panels`) have a script each.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import os
import re
import stat
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.types import Scope

from web import uplot
from web.joined_files import Joined, JoinError, join_modules, join_panels, join_styles
from web.panels import FOLDER, Document, Panel, places, with_panels
from web.theme import html_tag

STATIC = Path(__file__).parent / "static"
PLACE = "/static/"
"""Prefix of the URLs under which the folder is mounted."""
LARGEST = 1_000_000
"""Largest file that is held in memory, in bytes."""
VERSIONED = re.compile(r"v-([0-9a-f]{16})/(.*)", re.DOTALL)
JOINED = "joined/"
"""Folder of the joined scripts (`runs/runs.js`, and its `.map`) and styles (`runs/runs.css`)."""
_STYLES = re.compile(rf'<link rel="stylesheet" href="{PLACE}([^"]+)">\n?')
_SCRIPT = re.compile(rf'<script type="module" src="{PLACE}([^"]+)"></script>')
_JOINED = re.compile(rf"{JOINED}(?:\w{{1,60}}/){{0,4}}\w{{1,60}}(\.css|\.js|\.js\.map)", re.ASCII)
_TYPES = {".css": "text/css", ".js": "text/javascript", ".js.map": "application/json"}


class CachedFiles(StaticFiles):
    """Files of a folder, held in memory; a changed one is read again.

    Args:
        directory: the folder.
        panels, documents: those of extensions, whose files are below `extensions/NAME/`.

    Attributes:
        documents: names of the extensions' documents, by their addresses.
    """

    def __init__(
        self, directory: Path, panels: Sequence[Panel] = (), documents: Sequence[Document] = ()
    ) -> None:
        super().__init__(directory=directory)
        self._folder, self._panels = directory, panels
        shown: tuple[Panel | Document, ...] = (*panels, *documents)
        folders = {f"{FOLDER}{one.extension}/": one.folder for one in shown}
        self._folders = {**folders, "": directory}
        self._others = {
            name: StaticFiles(directory=one, check_dir=False) for name, one in folders.items()
        }
        self._checked: tuple[str, Mapping[Panel, str]] = "", {}
        self._kept: dict[str, tuple[int, int, bytes]] = {}
        self._version = ""
        self._left_out = {one: self._lacking(one) for one in documents}
        there = [one for one, why in self._left_out.items() if not why]
        self.documents = {one.place: one.file for one in there}
        self._names = [one.offer.name for one in there]
        self._joined: dict[str, tuple[str, bytes]] = {}  # by name: version and content
        self._packed: dict[str, tuple[str, bytes]] = {}  # the same, compressed

    def document(self, name: str) -> HTMLResponse:
        """Return a page of the folder, which names the other files by their present version.

        Raises JoinError for files that cannot be joined.
        """
        text = self._with_panels(name)
        self._version = self._versioned()
        if _STYLES.search(text):
            sheet = f"{JOINED}{name.removesuffix('.html')}.css"
            self._join(sheet, self._version)
            first, *others = _STYLES.split(text)[::2]
            link = f'<link rel="stylesheet" href="{PLACE}{sheet}">\n'
            text = first + link + "".join(others)
        if found := _SCRIPT.search(text):
            self._join(f"{JOINED}{found[1]}", self._version)
            text = text.replace(f'src="{PLACE}{found[1]}"', f'src="{PLACE}{JOINED}{found[1]}"')
        text = uplot.with_version(text.replace('<html lang="en">', html_tag(self._names), 1))
        return HTMLResponse(text.replace(f'"{PLACE}', f'"{PLACE}v-{self._version}/'))

    @property
    def problems(self) -> list[str]:
        """Return one line for each panel or document that cannot be shown."""
        found: tuple[tuple[Panel | Document, str], ...] = (
            *self._problems().items(),
            *self._left_out.items(),
        )
        return [
            f"extension {one.extension}: its {one.offer.kind} {one.offer.name} is left out: {why}"
            for one, why in found
            if why
        ]

    def _lacking(self, document: Document) -> str:
        """Return why a document cannot be shown, "" if it can."""
        try:
            text = self._read(document.file)
            join_styles(_STYLES.findall(text), self._read)
            for entry in _SCRIPT.findall(text):
                join_modules(entry, self._read, "", PLACE)
        except FileNotFoundError as error:
            return f"there is no file {error.filename}"
        except (JoinError, OSError, UnicodeDecodeError) as error:
            return str(error)
        return ""

    def _problems(self) -> Mapping[Panel, str]:
        """Return why each panel cannot be shown, "" for one that can."""
        version = self._versioned()
        if self._checked[0] != version:
            self._checked = version, {one: self._problem(one) for one in self._panels}
        return self._checked[1]

    def _problem(self, panel: Panel) -> str:
        try:
            known = [place for document in self._documents() for place in places(document)]
            if panel.offer.place not in known:
                return f"there is no place {panel.offer.place}; there are {', '.join(known)}"
            if any(f'id="{panel.offer.name}"' in one for one in self._documents()):
                return "a part of the page has this name; rename it"
            module, there = (
                panel.script.module,
                [one for one in self._panels if one.offer.place in known],
            )
            first = next(one for one in there if one.script.module == module)
            if self._page_of(first) != self._page_of(panel):
                other = f"{first.offer.name} of another page"
                return f"{module} shows {other}, too; write a module for each page"
            self._joined_panels([panel], "")
            join_styles(panel.styles, self._read)
        except FileNotFoundError as error:
            return f"there is no file {error.filename}"
        except (JoinError, OSError, UnicodeDecodeError) as error:
            return str(error)
        return ""

    def _with_panels(self, name: str) -> str:
        shown = [one for one, why in self._problems().items() if not why]
        return with_panels(self._read(name), shown, PLACE)

    def lookup_path(self, path: str) -> tuple[str, os.stat_result | None]:
        for name, files in self._others.items():
            if path.startswith(name):
                return files.lookup_path(path.removeprefix(name))
        return super().lookup_path(path)

    def _read(self, name: str) -> str:
        start = next(start for start in self._folders if name.startswith(start))
        return (self._folders[start] / name.removeprefix(start)).read_text(encoding="utf-8")

    def _join(self, name: str, version: str) -> bytes:
        """Return a joined file.

        Raises FileNotFoundError for a file that no page of the folder has, or JoinError.
        """
        made, content = self._joined.get(name, ("", b""))
        if made == version:
            return content
        stem = name.removeprefix(JOINED)
        if stem.endswith(".css"):
            sheets = _STYLES.findall(self._with_panels(f"{stem.removesuffix('.css')}.html"))
            self._joined[name] = version, join_styles(sheets, self._read).encode()
        else:
            entry = stem.removesuffix(".map")
            joined = self._joined_script(entry)
            self._joined[f"{JOINED}{entry}"] = version, joined.text.encode()
            self._joined[f"{JOINED}{entry}.map"] = version, joined.source_map.encode()
        return self._joined[name][1]

    def _joined_script(self, entry: str) -> Joined:
        map_address = f"{Path(entry).name}.map"
        fine = [panel for panel, why in self._problems().items() if not why]
        if mine := [panel for panel in fine if panel.script.module == entry]:
            return self._joined_panels(mine, map_address)
        there = [place for one in self._documents(entry) for place in places(one)]
        if not self._documents(entry):
            raise FileNotFoundError(entry)
        shown = [panel.script for panel in fine if panel.offer.place in there]
        return join_modules(entry, self._read, map_address, PLACE, shown)

    def _joined_panels(self, panels: Sequence[Panel], map_address: str) -> Joined:
        scripts, page = [one.script for one in panels], self._page_of(panels[0])
        return join_panels(scripts, page, self._read, map_address, PLACE)

    def _page_of(self, panel: Panel) -> str:
        """Return the module that the page with the place of a panel loads."""
        page = next(one for one in self._documents() if panel.offer.place in places(one))
        found = _SCRIPT.search(page)
        assert found is not None, "a document with places has a script"
        return found[1]

    def _documents(self, entry: str = "") -> list[str]:
        """Return the documents of the page that have a script, or all."""
        own = (one.read_text("utf-8") for one in self._folder.rglob("*.html"))
        pages = (*own, *map(self._read, self.documents.values()))
        return [text for text in pages if not entry or f'"{PLACE}{entry}"' in text]

    def _versioned(self) -> str:
        walked = (found for folder in self._folders.values() for found in os.walk(folder))
        files = (Path(of) / name for of, _, names in walked for name in names)
        about = [(str(path), path.stat()) for path in files]
        now = sorted((path, found.st_mtime_ns, found.st_size) for path, found in about)
        return hashlib.blake2b(repr(now).encode(), digest_size=8).hexdigest()

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return the file.

        Under a version other than the newest, the present file is returned without permission to
        cache it.
        """
        versioned = VERSIONED.fullmatch(path)
        if versioned is None:
            return await self._current(path, scope)
        response = await self._current(versioned[2], scope)
        if versioned[1] == self._version:
            response.headers.update(uplot.KEPT)
        return response

    async def _current(self, path: str, scope: Scope) -> Response:
        """Serve the file; unusual requests are left to the library."""
        if path.startswith(JOINED):
            return self._current_joined(path, scope)
        found, about = None, None
        with contextlib.suppress(OSError, ValueError):  # the library answers with the error
            found, about = self.lookup_path(path)
        usual = scope["method"] in ("GET", "HEAD") and "range" not in Headers(scope=scope)
        if not usual or not found or about is None or not _is_small_file(about):
            return await super().get_response(path, scope)
        response = self.file_response(found, about, scope)
        if isinstance(response, FileResponse):
            return Response(self._content(found, about), headers=dict(response.headers))
        return response

    def _current_joined(self, path: str, scope: Scope) -> Response:
        if scope["method"] not in ("GET", "HEAD"):
            raise HTTPException(405)
        if (found := _JOINED.fullmatch(path)) is None:
            raise HTTPException(404)
        version = self._versioned()
        headers = {"vary": "accept-encoding"}
        try:
            content = self._join(path, version)
        except FileNotFoundError:
            raise HTTPException(404) from None
        if "gzip" in Headers(scope=scope).get("accept-encoding", ""):
            headers["content-encoding"] = "gzip"
            if self._packed.get(path, ("", b""))[0] != version:
                self._packed[path] = version, gzip.compress(content, 6, mtime=0)
            content = self._packed[path][1]
        return Response(content, media_type=_TYPES[found[1]], headers=headers)

    def _content(self, path: str, about: os.stat_result) -> bytes:
        modified_ns, size, content = self._kept.get(path, (0, -1, b""))
        if (modified_ns, size) != (about.st_mtime_ns, about.st_size):
            content = Path(path).read_bytes()
            self._kept[path] = about.st_mtime_ns, about.st_size, content
        return content


FILES = CachedFiles(STATIC)
"""The page's own files."""


@cache
def files_with(panels: tuple[Panel, ...], documents: tuple[Document, ...] = ()) -> CachedFiles:
    """Return the page's files and those of extensions, which all vehicles share."""
    return CachedFiles(STATIC, panels, documents) if panels or documents else FILES


def _is_small_file(about: os.stat_result) -> bool:
    return stat.S_ISREG(about.st_mode) and about.st_size <= LARGEST
