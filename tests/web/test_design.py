"""The page's design has one source: tokens.css has all colours, type sizes, radii and motion."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from web.static_files import STATIC

TOKENS = STATIC / "core/tokens.css"
WEB = STATIC.parent
COLOUR = re.compile(
    r"#(?:[0-9a-f]{8}|[0-9a-f]{6}|[0-9a-f]{3,4})\b(?!-)|\b(?:rgba?|hsla?|oklch|lab)\(\s*[\d.]", re.I
)
SIZE = re.compile(r"\bfont(?:-size)?\s*[:=][^;}]*?(?<![\w/.-])[\d.]+(?:px|pt|r?em)\b", re.I)
SCHEME = re.compile(r"(?<!prefers-)color-scheme\s*:")
RADIUS = re.compile(r"border-radius:[^;}]*[1-9][\d.]*(?:px|r?em)")
MOTION = re.compile(r"(?:transition|animation)[\w-]*:[^;}]*[\d.]m?s\b")

RULES = (COLOUR, SIZE, RADIUS, MOTION, SCHEME)


def _rules(text: str) -> str:
    """Return a stylesheet without comments and selectors, in which `#bed` is a name."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return re.sub(r"(^|[{};])[^{};]*(?=\{)", r"\1", text)


def _own(path: Path) -> str:
    text = path.read_text("utf-8")
    if path.suffix == ".css":
        return _rules(text)
    return text if path.suffix == ".py" else re.sub(r"//.*", "", text)


FOLDERS = [STATIC, *sorted(WEB.parent.glob("extensions/*/page"))]
OTHERS = [
    one
    for kind in ("css", "js")
    for folder in FOLDERS
    for one in sorted(folder.rglob(f"*.{kind}"))
    if one != TOKENS
]
SMALL_PAGES = [
    WEB / name for name in ("access/pages.py", "commands/plain_emergency.py", "view/proxy.py")
]


def test_no_colour_and_no_type_size_stands_outside_the_tokens() -> None:
    for path in (*OTHERS, *SMALL_PAGES):
        text = _own(path)
        found = [one[0] for rule in RULES for one in rule.finditer(text)]
        assert found == [], path


@pytest.mark.parametrize(
    ("text", "is_found"),
    [
        ("a { color: #12ab34; }", True),
        ("a { background: rgb(1 2 3 / .5) }", True),
        ("a { font: 600 12px/1.2 var(--mono); }", True),
        ("a { font-size: .9em }", True),
        (":root { color-scheme: dark }", True),
        ("a { border-radius: 0 6px }", True),
        ("a { transition: width .2s }", True),
        ("#bed { width: 12px; font: var(--note)/20px var(--mono); border-radius: 0; }", False),
    ],
)
def test_the_search_finds_what_it_should(text: str, is_found: bool) -> None:
    rules = _rules(text)
    assert any(rule.search(rules) for rule in RULES) is is_found


def test_there_are_five_type_sizes_and_thirteen_base_colours() -> None:
    named = dict(re.findall(r"(--[\w-]+): ([^;]+);", TOKENS.read_text("utf-8")))
    sizes = [value for name, value in named.items() if re.fullmatch(r"[\d.]+px", value)]
    base = [name for name, value in named.items() if value.startswith("light-dark(")]
    type_sizes = [
        name for name in ("--small", "--note", "--body", "--lead", "--large") if name in named
    ]
    assert (len(type_sizes), len(base)) == (5, 13), (sizes, base)


def test_every_token_that_is_used_is_defined() -> None:
    defined = set(re.findall(r"(--[\w-]+):", TOKENS.read_text("utf-8")))
    own = re.compile(r"(--[\w-]+)\s*:|setProperty\(\"(--[\w-]+)\"")
    texts = {path: path.read_text("utf-8") for path in OTHERS}
    local = {name for text in texts.values() for pair in own.findall(text) for name in pair if name}
    used = {
        (path.relative_to(WEB.parent).as_posix(), name)
        for path, text in texts.items()
        for name in re.findall(r"var\((--[\w-]+)", text)
    }
    assert {one for one in used if one[1] not in defined | local} == set()


def test_every_page_loads_the_tokens_first() -> None:
    for page in (one for folder in FOLDERS for one in folder.rglob("*.html")):
        sheets = re.findall(r'rel="stylesheet" href="/static/([^"]+)"', page.read_text("utf-8"))
        assert sheets[0] == "core/tokens.css", page
