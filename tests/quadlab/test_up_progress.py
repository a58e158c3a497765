"""What `quadlab up` says until its page does."""

from __future__ import annotations

import contextlib
import socket

import pytest

from quadlab.commands import up


def test_the_start_goes_on_until_the_page_answers_and_not_only_listens(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(up, "PROGRESS_PERIOD", 0.01)
    said = ""
    with (
        socket.create_server(("127.0.0.1", 0)) as page,
        contextlib.ExitStack() as unanswered,
        up._Progress(*page.getsockname()) as progress,
    ):
        page.settimeout(0.1)
        while progress._thread.is_alive():
            said += capsys.readouterr().out
            with contextlib.suppress(OSError):
                asking = unanswered.enter_context(page.accept()[0])
                if "starting, " in said:
                    asking.sendall(b"HTTP/1.0 200 OK\r\n\r\n")
    assert "starting, " in said
