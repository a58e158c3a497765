"""Hooks that mkdocs calls while it builds the site: pages from the code, and links out of docs/.

The documents are written for a git host, where a link may lead to any file of the repository,
and one to a folder shows its README. In the site such a file has a page of its own.
"""

from __future__ import annotations

import os
import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from extensions.documents.diagrams import svg
from quadrotor.checkout import ROOT
from scripts.docs.reference import PAGES, code_page

DOCS = ROOT / "docs"
OUTSIDE = "repository/"
"""Folder of the site with the files outside docs/ that a document links to."""
LINK = re.compile(r"(\]\()([^)\s#]+)([^)\s]*)(?=\))")
ELSEWHERE = re.compile(
    r'<(?:script|img|iframe)[^>]+src="?https?://|<link[^>]+rel="?stylesheet[^>]+https?://'
)
"""A pattern of files that a page would load from another computer."""
PREFORMATTED = re.compile(r"<pre.*?</pre>", re.DOTALL)
STAYED_TEXT = re.compile(r"<p>\|.*|^(?:- |\d+\. ).*|^```.*", re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made of the code, and those of linked files outside docs/."""
    for name, page in PAGES.items():
        files.append(File.generated(config, f"reference/{name}.md", content=page()))
    waiting = [DOCS / file.src_uri for file in files.documentation_pages() if file.abs_src_path]
    shown: set[Path] = set()
    while waiting:
        document = waiting.pop()
        for found in LINK.finditer(document.read_text(encoding="utf-8")):
            target = _target(document, found[2])
            if target is None or target.is_relative_to(DOCS) or target in shown:
                continue
            shown.add(target)
            uri, text = _uri(target), target.read_text(encoding="utf-8")
            if target.suffix == ".md":
                waiting.append(target)
            else:
                text = code_page(target.relative_to(ROOT).as_posix(), target)
            files.append(File.generated(config, uri, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return the text with each link to a file of the repository leading to its page."""
    uri = page.file.src_uri
    document = ROOT / uri.removeprefix(OUTSIDE) if uri.startswith(OUTSIDE) else DOCS / uri

    def led(link: re.Match[str]) -> str:
        target = _target(document, link[2])
        if target is None:
            return link[0]
        return link[1] + posixpath.relpath(_uri(target), posixpath.dirname(uri)) + link[3]

    return LINK.sub(led, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Refuse a table or a list that stayed text: Markdown of git hosts needs no empty line before
    it, this one does."""
    if found := STAYED_TEXT.search(PREFORMATTED.sub("", html)):
        raise PluginError(f"{page.file.src_uri}: an empty line is missing before {found[0]!r:.80}")
    return html


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Refuse a page that would load anything from another computer."""
    if found := ELSEWHERE.search(output):
        raise PluginError(f"{page.file.src_uri} would load {found[0]}: keep the site on its own")
    return output


def _target(document: Path, link: str) -> Path | None:
    """Return the file that a relative link means, of a folder its README; None for others."""
    if ":" in link or link.startswith("/"):
        return None
    target = Path(os.path.normpath(document.parent / link))
    target = target / "README.md" if target.is_dir() else target
    return target if target.is_file() and target.is_relative_to(ROOT) else None


def _uri(target: Path) -> str:
    """Return the place of a file's page in the site's sources."""
    if target.is_relative_to(DOCS):
        return target.relative_to(DOCS).as_posix()
    path = target.relative_to(ROOT).as_posix()
    return OUTSIDE + (path if path.endswith(".md") else f"{path}.md")


def fence(source: str, *_: object, **__: object) -> str:
    """Return what pymdownx.superfences puts in place of a block of mermaid."""
    return f'<div style="overflow-x:auto;margin:1em 0">{svg(source)}</div>'
