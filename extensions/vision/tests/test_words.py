"""Wrong words of cameras are answered in one line, and wrong files refused in one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from extensions.vision.tags.intrinsics import read_yaml
from extensions.vision.tags.tag_layout import load_tags
from quadlab.__main__ import main
from quadrotor.errors import QuadlabError

NEST = "[" * 20_000 + "]" * 20_000
CAMERAS = ("tracker", "camera", "--tags", "tags.toml", "--device")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([*CAMERAS, "0", "1", "--intrinsics", "a.yaml"], "1 files, but there are 2 cameras (0, 1)"),
        ([*CAMERAS, "1", "1", "--intrinsics", "a.yaml", "b.yaml"], "camera 1 is given twice"),
        ([*CAMERAS, *"01234", "--intrinsics", *"abcde"], "5 cameras; camera reads at most 4"),
        (["up", "--tracker", "camera --rendered 5"], "5 cameras; camera reads at most 4"),
        (
            ["tracker", "onboard_camera", "--rendered", "1"],
            "the system camera renders 1 to 4 cameras, and one vehicle",
        ),
    ],
)
def test_wrong_words_are_answered_in_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(words) == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("quadlab: ")
    assert said in line


@pytest.mark.parametrize(
    ("name", "content", "read"),
    [
        ("a.yaml", NEST, lambda path: read_yaml(path, "calibrate")),
        ("a.toml", f"tags = {NEST}", load_tags),
    ],
)
def test_a_nested_file_is_refused_in_one_line(
    tmp_path: Path, name: str, content: str, read: Callable[[Path], object]
) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(QuadlabError) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500
