"""The figures of the source tree and their budget, for made-up sources."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import pytest

from benchmarks.house.budget import excesses, lowered, read_budget
from benchmarks.house.graph import book, import_graph, into_extensions, knots, loops
from benchmarks.house.sources import LONG_FUNCTION, Source
from quadrotor.errors import UsageError


def source(path: str, text: str = "") -> Source:
    return Source(PurePosixPath(path), text)


def test_code_lines_are_neither_blank_nor_comments_nor_docstrings() -> None:
    text = '"""A module."""\n\n# why\nLIMIT = 3\n"""A limit."""\n'
    text += 'def f():\n    """Return."""\n    return 1\n'
    assert source("a/b.py", text).lines == 4


def test_long_functions_positional_calls_and_any_are_counted() -> None:
    body = "    x = 1\n" * LONG_FUNCTION
    one = source(
        "a/b.py", f"def f():\n{body}\ndef g(a: Any):\n    h(1, 2, 3, 4, 5, 6, 7)\n    h(1)\n"
    )
    assert one.long_functions == [(LONG_FUNCTION + 1, "a/b.py f")]
    assert (one.positional_calls, one.anys) == (1, 1)


def test_a_book_is_all_that_is_imported_also_lazily() -> None:
    start = source("a/start.py", "from a import near\ndef f():\n    from b.far import X\n")
    near, far, other = source("a/near.py"), source("b/far.py"), source("b/other.py")
    graph = import_graph([start, near, far, other])
    assert book(graph, start.path) == {start, near, far}


def test_a_book_has_what_the_offers_of_its_modules_name() -> None:
    start = source("a/start.py", 'OWN = Offer(name="x", target=".near:X"), Offer(target=".gone:X")')
    near, other = source("a/near.py"), source("b/near.py")
    assert book(import_graph([start, near, other]), start.path) == {start, near}


def test_folders_that_import_each_other_are_a_knot() -> None:
    graph = import_graph(
        [
            source("a/one/x.py", "from a.two import y\n"),
            source("a/two/y.py", "from a.three.z import Z\n"),
            source("a/three/z.py", "def f():\n    import a.one.x\n"),
            source("a/four.py", "from a.one import x\n"),
            source("b/one/x.py", "from a.one import x\n"),
        ]
    )
    assert knots(graph) == {"a": [["a/one", "a/three", "a/two"]]}
    assert loops({"p": {"q"}, "q": {"p"}, "r": {"p", "s"}, "s": {"r"}}) == [["p", "q"], ["r", "s"]]


def test_core_may_not_import_an_extension_nor_one_extension_another() -> None:
    graph = import_graph(
        [
            source("web/app.py", "from extensions.fmu.extension import EXTENSION\n"),
            source("extensions/fmu/extension.py", "from extensions.fmu import export\n"),
            source("extensions/fmu/export.py", "from extensions.mavlink.peer import Peer\n"),
            source("extensions/mavlink/peer.py"),
        ]
    )
    assert into_extensions(graph) == [
        "extensions/fmu/export.py imports extensions/mavlink/peer.py",
        "web/app.py imports extensions/fmu/extension.py",
    ]


def test_a_figure_above_its_limit_or_without_one_is_told(tmp_path: Path) -> None:
    path = tmp_path / "budget.toml"
    path.write_text(
        'core = 10\n"long functions" = { limit = 3, reason = "a new door" }\ngone = 1\n'
    )
    found = excesses({"core": 11, "long functions": 3, "new": 0}, read_budget(path), path)
    assert [line.partition(",")[0].partition(";")[0] for line in found] == [
        "core is 11",
        "gone is no figure",
        f"new has no limit in {path}",
    ]


def test_limits_are_lowered_and_never_raised(tmp_path: Path) -> None:
    path = tmp_path / "budget.toml"
    path.write_text('# Why\ncore = 10\nAny = { limit = 5, reason = "a codec" }\n"wide" = 3\n')
    assert lowered({"core": 12, "Any": 4, "wide": 3}, path) == 1
    assert read_budget(path) == {"core": 10, "Any": 4, "wide": 3}
    assert path.read_text().startswith("# Why\n")


@pytest.mark.parametrize("given", ['"a"', "true", "{ limit = 5 }", '{ limit = 5, reason = " " }'])
def test_a_limit_that_is_none_or_has_no_reason_is_refused(tmp_path: Path, given: str) -> None:
    path = tmp_path / "budget.toml"
    path.write_text(f"core = {given}\n")
    with pytest.raises(UsageError, match=r"core is .*; allowed are N, and .* reason"):
        read_budget(path)
