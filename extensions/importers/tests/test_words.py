"""Wrong words for the commands of this extension are answered in one line."""

from __future__ import annotations

import pytest

from tests.quadlab.test_command_line import complaint


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["log", "import", "x.csv", "--out", "y"],
            "quadlab log import has no --out: its options are --mapping, --propose, --truth, "
            "--table, --stamps, --flight, --name, --torn, --data;",
        ),
        (["log", "import", "--out", "y"], "quadlab log import has no --out"),
    ],
)
def test_wrong_words_are_answered_in_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in complaint(capsys, words, 2)
