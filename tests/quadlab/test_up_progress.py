"""Output of `quadlab up` until its page answers."""

from __future__ import annotations

import select
import socket

import pytest

from quadlab.commands.up import Up
from quadlab.up import progress as module

BOUND = 20.0  # s


def test_the_start_goes_on_until_the_page_answers_and_not_only_listens(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "PROGRESS_PERIOD", 0.05)
    said = ""
    with socket.create_server(("127.0.0.1", 0)) as page:
        page.settimeout(BOUND)
        progress = module.Progress(*page.getsockname())
        progress.report()
        asking, _ = page.accept()
        with asking:
            while "starting, " not in said and not progress.is_over:
                progress.report()
                said += capsys.readouterr().out
            asking.sendall(b"HTTP/1.0 200 OK\r\n\r\n")
            assert progress._page is not None
            assert select.select([progress._page], [], [], BOUND)[0]
            progress.report()
        assert progress.is_over
    assert "starting, " in said


@pytest.mark.parametrize(
    ("words", "served"),
    [
        ("vrpn", ["--serve", "vrpn"]),
        ("natnet --port=2510", ["--serve", "natnet=2510"]),
        ("qtm --host 10.0.0.2", []),
        ("udp --port 5005", []),
        (" ", []),
    ],
)
def test_the_simulator_serves_the_system_that_no_other_host_does(
    words: str, served: list[str]
) -> None:
    assert Up(tracker=words)._serve_words() == served
