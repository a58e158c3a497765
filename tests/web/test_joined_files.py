"""One script of a page's modules: the same names, the same lines; others are refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from web.joined_files import JoinError, join_modules, join_styles
from web.static_files import STATIC, CachedFiles

ENTRIES = sorted(str(path.relative_to(STATIC)) for path in STATIC.glob("*/*.html"))
DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
Read = Callable[[str], str]


def reader(files: dict[str, str]) -> Read:
    def read(name: str) -> str:
        if name not in files:
            raise FileNotFoundError(name)
        return files[name]

    return read


def joined(files: dict[str, str], entry: str = "a.js") -> str:
    return join_modules(entry, reader(files), f"{entry}.map", "/static/").text


def places(source_map: str) -> Iterator[tuple[str, int] | None]:
    """Yield, for each line of the script, the file and line of its source, both from 0."""
    told = json.loads(source_map)
    file = line = 0
    for one in told["mappings"].split(";"):
        if not one:
            yield None
            continue
        values, shift, value = [], 0, 0
        for digit in map(DIGITS.index, one):
            value |= (digit & 31) << shift
            shift += 5
            if not digit & 32:
                values.append(-(value >> 1) if value & 1 else value >> 1)
                shift = value = 0
        file, line = file + values[1], line + values[2]
        yield told["sources"][file], line


def test_modules_stand_after_those_they_import_and_once() -> None:
    text = joined(
        {
            "a.js": 'import { b } from "./b.js";\nimport { c as d } from "./c.js";\nb(d);\n',
            "b.js": 'import { c } from "./c.js";\nexport function b() { return c; }\n',
            "c.js": "export const c = 1, e = 2;\nexport class Unused {}\n",
        }
    )
    assert re.findall(r"^// ---- (\S+)$", text, re.MULTILINE) == ["c.js", "b.js", "a.js"]
    assert "const { c: d } = $$c;" in text
    assert "return { c };" in text
    assert not re.search(r"^(import|export)\b", text, re.MULTILINE)


def test_an_import_is_relative_to_the_folder_of_its_module() -> None:
    text = joined(
        {
            "a/b.js": 'import { c } from "../c/d.js";\nimport { c as e } from "./d.js";\n',
            "c/d.js": 'import { f } from "../a/f.js";\nexport const c = f;\n',
            "a/d.js": "export const c = 2;\n",
            "a/f.js": "export const f = 1;\n",
        },
        "a/b.js",
    )
    found = re.findall(r"^// ---- (\S+)$", text, re.MULTILINE)
    assert found == ["a/f.js", "c/d.js", "a/d.js", "a/b.js"]
    assert "const { c } = $$c$d;\nconst { c: e } = $$a$d;" in text


def _without_imports(file: Path) -> list[str | None]:
    """Return the lines of a module, None for those of its imports."""
    lines: list[str | None] = []
    inside = False
    for line in file.read_text().split("\n"):
        inside = inside or line.startswith("import ")
        lines.append(None if inside else line)
        inside = inside and not line.endswith(";")
    return lines


@pytest.mark.parametrize("page", ENTRIES)
def test_each_line_of_each_page_s_script_is_found_in_its_file(page: str) -> None:
    entry = re.search(r'type="module" src="/static/([^"]+)"', (STATIC / page).read_text())
    assert entry is not None
    made = join_modules(entry[1], lambda name: (STATIC / name).read_text(), "x.map", "/static/")
    files = {name: _without_imports(STATIC / name) for name in _names(made.source_map)}
    lines, seen = made.text.split("\n"), 0
    for text, place in zip(lines, places(made.source_map), strict=False):
        if place is None:
            continue
        source = files[place[0].removeprefix("/static/")][place[1]]
        if source is None:
            continue
        assert text == source.removeprefix("export ")
        seen += 1
    assert seen > 30


def _names(source_map: str) -> list[str]:
    return [one.removeprefix("/static/") for one in json.loads(source_map)["sources"]]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"a.js": "\nexport default 1;"}, "a.js, line 2: export default 1; cannot be joined"),
        ({"a.js": "const b = 1;\nexport { b };"}, r"a.js, line 2: export \{ b \}"),
        ({"a.js": 'export * from "./b.js";'}, "a.js, line 1: export \\*"),
        ({"a.js": "export let b = 1;"}, "a.js, line 1: export let b"),
        ({"a.js": 'import * as b from "./b.js";'}, "a.js, line 1: import \\* as b"),
        ({"a.js": 'import b from "./b.js";'}, "a.js, line 1: import b from"),
        ({"a.js": 'import { b } from "/b.js";'}, "a.js, line 1: import { b } from"),
        ({"a.js": 'x();\nconst b = await import("./b.js");'}, "a.js, line 2: import"),
        ({"a.js": "\n\nf(import.meta.url);"}, "a.js, line 3: import.meta"),
        ({"a.js": 'import { default as b } from "./b.js";'}, "import { default as b }"),
        ({"a.js": 'import { b } from "./b.js";'}, "no module b.js, which a.js imports"),
        ({"a.js": 'import { b } from "../b.js";'}, "no module ../b.js, which a.js imports"),
        (
            {"a.js": 'import { b } from "./b.js";', "b.js": "const b = 1;\nexport const c = b;"},
            "a.js imports b of b.js, which does not export it",
        ),
        (
            {"a.js": 'import { b } from "./b.js";', "b.js": "\nexport const b = await f();"},
            "b.js, line 2: only a.js, which the page loads, may await",
        ),
        (
            {"a.js": 'import { b } from "./b.js";', "b.js": 'import "./a.js";'},
            "a.js → b.js → a.js: modules that import each other",
        ),
    ],
)
def test_what_cannot_be_joined_is_told_with_file_and_line(files: dict[str, str], said: str) -> None:
    with pytest.raises(JoinError, match=said):
        joined(files)


def test_what_the_page_loads_may_await() -> None:
    text = joined({"a.js": 'import { b } from "./b.js";\nawait b();', "b.js": "export class b {}"})
    assert text.split("// ---- a.js\n")[1].startswith("const { b } = $$b;\nawait b();\n")


def test_styles_keep_their_order_and_bring_nothing_along() -> None:
    read = reader({"a.css": "a {}\n", "b.css": "b { background: url(x.png); }", "c.css": "c {}"})
    text = join_styles(["c.css", "a.css"], read)
    assert text.index("c {}") < text.index("a {}")
    with pytest.raises(JoinError, match=r"b\.css, line 1"):
        join_styles(["a.css", "b.css"], read)


def test_a_changed_file_is_joined_anew(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(
        '<link rel="stylesheet" href="/static/a.css">\n<p></p>\n'
        '<link rel="stylesheet" href="/static/b.css">\n'
        '<script type="module" src="/static/a.js"></script>'
    )
    for name in ("a.css", "b.css", "a.js"):
        (tmp_path / name).write_text(f"/* {name} */")
    files = CachedFiles(tmp_path)
    first = bytes(files.document("page.html").body).decode()
    assert re.findall(r'"/static/v-[0-9a-f]{16}/([^"]+)"', first) == [
        "joined/page.css",
        "joined/a.js",
    ]
    (tmp_path / "a.js").write_text("/* another */")
    assert bytes(files.document("page.html").body).decode() != first
