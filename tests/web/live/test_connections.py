"""Connections that wait for nothing leave the page its descriptors."""

from __future__ import annotations

import socket
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from console.catalogue.catalogue import Catalogue
from web.access.tls import private_tls
from web.live import connections

MOST = 20
UNFINISHED = {
    "that send nothing": b"",
    "whose head never ends": b"GET /login HTTP/1.1\r\nHost: ",
    "whose body never ends": b"POST /login HTTP/1.1\r\nHost: %s\r\nContent-Length: 9\r\n\r\na=",
}


@pytest.mark.parametrize("sent", UNFINISHED)
def test_of_connections_that_wait_the_oldest_end_and_the_page_answers(
    site: Any, monkeypatch: pytest.MonkeyPatch, sent: str
) -> None:
    monkeypatch.setattr(connections, "WAITING_MOST", MOST)
    address = urlsplit(site.base)
    place = (address.hostname, address.port or 0)
    begun = UNFINISHED[sent].replace(b"%s", address.netloc.encode())
    with ExitStack() as held:
        opened = []
        for _ in range(2 * MOST):
            one = held.enter_context(socket.create_connection(place, 10))
            one.sendall(begun)
            opened.append(one)
        for one in opened[: MOST - 1]:  # those that still wait are younger
            with suppress(ConnectionResetError):
                while one.recv(1024):
                    pass
        with socket.create_connection(place, 10) as page:
            page.sendall(b"GET /login HTTP/1.1\r\nHost: %s\r\n\r\n" % address.netloc.encode())
            assert page.recv(1024).startswith(b"HTTP/1.1 200")


def test_of_tls_handshakes_that_are_not_begun_the_oldest_end_and_the_page_answers(
    serve: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "WAITING_MOST", MOST)
    catalogue = Catalogue(tmp_path)
    with serve(tmp_path, catalogue, tls=private_tls(tmp_path, ())) as site, ExitStack() as held:
        address = urlsplit(site.base)
        opened = [
            held.enter_context(socket.create_connection((address.hostname, address.port or 0), 10))
            for _ in range(2 * MOST)
        ]
        for one in opened[: MOST - 1]:
            with suppress(ConnectionResetError):
                assert one.recv(1024) == b""
        with site.browser() as client:
            assert client.get("/login").status_code == 200
            assert client.get("/login").status_code == 200
    catalogue.close()
