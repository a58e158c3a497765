"""The documents of `docs/` as pages: Markdown as git hosts read it, in the page's own look."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Sequence
from functools import cache
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from markdown_it.utils import EnvType, OptionsDict

from extensions.documents.diagrams import svg
from quadrotor.checkout import ROOT

DOCS = ROOT / "docs"
HOME = "index.md"
_BLOCK = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
_WORD = re.compile(r"[^\W\d_]{3,}|\b\d\b")
_HEADING = re.compile(r"^#{1,6} .*", re.MULTILINE)


class Heading(NamedTuple):
    """A heading of a document.

    Attributes:
        anchor: the fragment of its address, as git hosts form it.
    """

    level: int
    text: str
    anchor: str


class Document(NamedTuple):
    """A document that has been read.

    Attributes:
        title: its first heading.
        body: its HTML, without the frame of a page.
    """

    title: str
    headings: tuple[Heading, ...]
    body: str


def headings(path: str) -> list[Heading]:
    """Return the headings of a document by its path below `docs`; quicker than `read`."""
    file = DOCS / path
    return _headings(file, file.stat().st_mtime_ns)


def section_words(path: str) -> list[str]:
    """Return the words of each section of a document, each once, in the order of `headings`."""
    file = DOCS / path
    return _section_words(file, file.stat().st_mtime_ns)


@cache
def _section_words(file: Path, changed_ns: int) -> list[str]:
    del changed_ns  # a part of the key
    text = _text(file)
    in_code = [found.span() for found in _BLOCK.finditer(text)]
    begins = [
        found.start()
        for found in _HEADING.finditer(text)
        if not any(begin <= found.start() < end for begin, end in in_code)
    ]
    parts = (text[begin:end] for begin, end in pairwise([*begins, len(text)]))
    return [" ".join(dict.fromkeys(_WORD.findall(part.lower()))) for part in parts]


@cache
def _headings(file: Path, changed_ns: int) -> list[Heading]:
    del changed_ns  # a part of the key
    text = _BLOCK.sub("", _text(file))
    return _numbered(_markdown().parse("\n\n".join(_HEADING.findall(text))))


def _text(file: Path) -> str:
    """Return the text of a document without what is for the site: settings before it, frames."""
    return re.sub(
        r"\A---\n.*?^---\n|^<iframe .*?$", "", file.read_text(encoding="utf-8"), flags=re.S | re.M
    )


def paths() -> list[str]:
    """Return the documents, as paths below `docs`."""
    return sorted(file.relative_to(DOCS).as_posix() for file in DOCS.rglob("*.md"))


def read(path: str) -> Document:
    """Return a document by its path below `docs`, one of `paths()`."""
    file = DOCS / path
    return _read(file, file.stat().st_mtime_ns)


@cache
def _read(file: Path, changed_ns: int) -> Document:
    del changed_ns  # a part of the key
    tokens = _markdown().parse(_text(file))
    headings = tuple(_numbered(tokens))
    for token in tokens:
        _lead(token.children or [], file.parent)
        if style := token.attrs.pop("style", ""):  # which the page's security policy forbids
            token.attrs["class"] = str(style).removeprefix("text-align:")
    title = headings[0].text if headings else file.stem
    return Document(title, headings, _markdown().renderer.render(tokens, _markdown().options, {}))


@cache
def _markdown() -> MarkdownIt:
    made = MarkdownIt("commonmark", {"html": False}).enable("table")
    made.add_render_rule("fence", _fence)
    return made


def _fence(
    self: RendererHTML, tokens: Sequence[Token], at: int, options: OptionsDict, env: EnvType
) -> str:
    """Return the HTML of a block of code; a flow chart is drawn."""
    token = tokens[at]
    if token.info.strip() == "mermaid":
        return f'<figure class="chart">{svg(token.content)}</figure>\n'
    return f"<pre><code>{escape(token.content)}</code></pre>\n"


def _numbered(tokens: Sequence[Token]) -> list[Heading]:
    """Return the headings, and give each an id; of equal ones the later have a number."""
    found: list[Heading] = []
    for at, token in enumerate(tokens):
        if token.type == "heading_open":
            text = "".join(child.content for child in tokens[at + 1].children or ())
            anchor = slug(text)
            same = sum(slug(one.text) == anchor for one in found)
            anchor += f"-{same}" if same else ""
            token.attrs["id"] = anchor
            found.append(Heading(int(token.tag[1:]), text, anchor))
    return found


def slug(text: str) -> str:
    """Return the anchor of a heading, as git hosts form it."""
    return re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")


def _lead(children: Sequence[Token], folder: Path) -> None:
    """Let the links of a paragraph lead to pages; those to code become text that names its file.

    Args:
        folder: the folder of the document.
    """
    outside = False
    for child in children:
        if child.type == "link_open":
            link, _, fragment = str(child.attrs["href"]).partition("#")
            target = _resolved(link, folder)
            outside = target is not None and not target.is_relative_to(DOCS)
            if outside and target is not None:
                file = target.relative_to(ROOT).as_posix() if target.is_relative_to(ROOT) else link
                child.tag, child.attrs = "span", {"class": "file", "title": f"{file} of quadlab"}
            elif target is not None and link:
                shown = posixpath.join(link, "README.md") if target.is_dir() else link
                page = re.sub(r"\.md$", ".html", shown)
                child.attrs["href"] = page + (f"#{fragment}" if fragment else "")
        elif child.type == "link_close" and outside:
            child.tag, outside = "span", False


def _resolved(link: str, folder: Path) -> Path | None:
    """Return the file or folder of a link; None if it leads to another computer."""
    return None if re.match(r"\w+:", link) else (folder / link).resolve()
