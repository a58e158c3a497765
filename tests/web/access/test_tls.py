"""The page under TLS, over a real socket, trusted by the data folder's own authority."""

from __future__ import annotations

import asyncio
import datetime
import json
import ssl
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets.asyncio.client
import websockets.exceptions
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID
from starlette.responses import Response

from console.catalogue.catalogue import Catalogue
from quadrotor.errors import UsageError
from vehicle_link.security.authority import check_certificate, ensure_certificates, make_certificate
from vehicle_link.security.certificates import load_certificate
from vehicle_link.security.page_authority import NAME, WEB_DAYS, ensure_web_certificate, permits
from vehicle_link.security.tls_files import TlsFiles, signing_key
from web.access.listen_address import check_listen_address, is_loopback
from web.access.people import SessionCookie
from web.access.tls import given_tls, own_names, private_tls, shown_host
from web.assembly import allowed_hosts
from web.live.sockets import plain_transport


@pytest.fixture(scope="module")
def tls_site(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    data = tmp_path_factory.mktemp("tls")
    catalogue = Catalogue(data)
    with serve(data, catalogue, tls=private_tls(data, ())) as running:
        yield running
    catalogue.close()


def test_the_page_and_its_api_are_served_to_who_trusts_the_authority(tls_site: Any) -> None:
    assert tls_site.base.startswith("https://127.0.0.1:")
    assert tls_site.links[0].startswith(tls_site.base)
    with tls_site.sign_in() as client:
        assert client.get("/api/session").json()["role"] == "admin"
        assert client.get("/").headers.get("strict-transport-security") is None


def test_who_does_not_trust_the_authority_gets_nothing(tls_site: Any) -> None:
    with pytest.raises(httpx.ConnectError, match="CERTIFICATE_VERIFY_FAILED"):
        httpx.get(tls_site.base)


def test_under_tls_the_cookie_is_for_tls_only(tls_site: Any) -> None:
    with tls_site.browser() as client:
        cookie = client.post("/login", data={"token": tls_site.token}).headers["set-cookie"]
    assert cookie.startswith(f"__Host-quadlab_{tls_site.host.split(':')[1]}=")
    for flag in ("Secure", "HttpOnly", "SameSite=strict", "Path=/"):
        assert flag in cookie


def test_without_tls_the_cookie_is_not_secure_for_a_browser_would_drop_it() -> None:
    answer = Response()
    SessionCookie("http://127.0.0.1:8080").set(answer, "x")
    assert "Secure" not in answer.headers["set-cookie"]
    assert answer.headers["set-cookie"].startswith("quadlab_8080=x")


def first_message(site: Any, client: httpx.Client, origin: str) -> dict[str, Any]:
    """Return the first message of `/ws/events`, read with asyncio.

    A client that reads in one thread and writes in another uses one OpenSSL connection from both,
    which Python before 3.13 does not guard; it hangs.
    """

    async def listen() -> dict[str, Any]:
        async with websockets.asyncio.client.connect(
            f"wss://{site.host}/ws/events",
            ssl=site.verify,
            additional_headers={"Cookie": site.cookie(client)},
            origin=websockets.Origin(origin),
            proxy=None,
            open_timeout=60.0,
        ) as socket:
            message: dict[str, Any] = json.loads(await socket.recv())
            return message

    return asyncio.run(listen())


def test_a_websocket_works_under_tls(tls_site: Any) -> None:
    with tls_site.sign_in() as client:
        hello = first_message(tls_site, client, tls_site.base)
    assert hello["type"] == "hello"
    assert hello["session"]["role"] == "admin"


def test_the_same_host_without_tls_is_another_site(tls_site: Any) -> None:
    plain = f"http://{tls_site.host}"
    with tls_site.sign_in() as client:
        for origin, status in ((plain, 403), (tls_site.base, 200)):
            answer = client.post("/api/commands/arm", json={}, headers={"Origin": origin})
            assert answer.status_code == status
        with pytest.raises(websockets.exceptions.InvalidStatus) as caught:
            first_message(tls_site, client, plain)
    assert caught.value.response.status_code == 403


def test_invitations_are_links_of_https(tls_site: Any) -> None:
    with tls_site.sign_in() as client:
        answer = client.post("/api/invitations", json={"role": "viewer"}).json()
    assert answer["url"].startswith(f"{tls_site.base}/?token=")
    assert (answer["here_only"], answer["picture"]) == (True, ""), "no telephone reaches loopback"


def test_the_small_buffers_of_live_sockets_reach_below_tls() -> None:
    """`plain_transport` uses private names of asyncio, which must still exist."""
    from asyncio import sslproto

    loop = asyncio.new_event_loop()
    try:
        protocol = sslproto.SSLProtocol(
            loop,
            asyncio.Protocol(),
            ssl.create_default_context(),
            loop.create_future(),
            server_hostname="x",
        )
        below = asyncio.Transport()
        protocol._transport = below
        assert plain_transport(sslproto._SSLProtocolTransport(loop, protocol)) is below
        assert plain_transport(below) is None
    finally:
        loop.close()


def test_the_certificate_is_one_that_browsers_take(tmp_path: Path) -> None:
    files = ensure_web_certificate(tmp_path, ["base.lab", "192.0.2.7"])
    held = load_certificate(files.certificate("web"))
    assert held.not_valid_after_utc - held.not_valid_before_utc <= datetime.timedelta(WEB_DAYS)
    for name in ("base.lab", "192.0.2.7", "localhost", "127.0.0.1", "::1"):
        check_certificate(files, "web", name)
    purposes = held.extensions.get_extension_for_class(x509.ExtendedKeyUsage)
    assert list(purposes.value) == [ExtendedKeyUsageOID.SERVER_AUTH]


def verified(authority: Path, certificate: Path, host: str) -> str:
    """Return why OpenSSL would not accept a server of this name, "" if it does."""
    kind = "-verify_ip" if host[0].isdigit() or ":" in host else "-verify_hostname"
    words = ["openssl", "verify", "-x509_strict", "-CAfile", str(authority), kind, host]
    ran = subprocess.run([*words, str(certificate)], capture_output=True, text=True, check=False)
    return "" if ran.returncode == 0 else ran.stderr


def test_the_pages_authority_can_stand_for_no_other_site(tmp_path: Path) -> None:
    """The authority is imported into browsers: its key is worth as little as can be to a thief."""
    files = ensure_web_certificate(tmp_path, ["base.lab", "192.0.2.7", "10.1.2.3"])
    authority = load_certificate(files.authority)
    for name in ("base.lab", "192.0.2.7", "10.1.2.3", "quad.local", "192.168.4.2", "fe80::1"):
        assert permits(authority, name), name
    for name in ("bank.example", "local.example", "1.1.1.1", "192.0.2.8", "2001:db8::1"):
        assert not permits(authority, name), name
    for host in ("base.lab", "192.0.2.7", "10.1.2.3", "localhost", "127.0.0.1", "::1"):
        assert verified(files.authority, files.certificate("web"), host) == ""
    stolen = TlsFiles(tmp_path / "stolen", is_page=True)
    stolen.folder.mkdir()
    make_certificate(stolen, "web", ["bank.example"], signing_key(files), issuer=NAME)
    said = verified(files.authority, stolen.certificate("web"), "bank.example")
    assert "permitted subtree violation" in said
    link = ensure_certificates(tmp_path)
    assert link.authority.read_bytes() != files.authority.read_bytes()


def test_the_pages_authority_is_made_again_for_a_name_that_it_does_not_permit(
    tmp_path: Path,
) -> None:
    files = ensure_web_certificate(tmp_path, ["base.lab", "quad.local"])
    first = files.authority.read_bytes()
    ensure_web_certificate(tmp_path, ["10.9.9.9", "other.local", "x.base.lab"])
    assert files.authority.read_bytes() == first
    ensure_web_certificate(tmp_path, ["other.lab"])
    assert files.authority.read_bytes() != first
    for host in ("base.lab", "quad.local", "10.9.9.9", "other.lab"):
        assert verified(files.authority, files.certificate("web"), host) == ""


def test_the_certificate_stays_until_a_name_is_new(tmp_path: Path) -> None:
    first = ensure_web_certificate(tmp_path, ["base.lab"]).certificate("web").read_bytes()
    again = ensure_web_certificate(tmp_path, []).certificate("web").read_bytes()
    other = ensure_web_certificate(tmp_path, ["other.lab"])
    assert again == first
    assert other.certificate("web").read_bytes() != first
    check_certificate(other, "web", "base.lab")
    check_certificate(other, "web", "other.lab")


def test_a_certificate_that_ends_soon_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vehicle_link.security.page_authority.WEB_DAYS", 30)
    first = ensure_web_certificate(tmp_path, []).certificate("web").read_bytes()
    monkeypatch.undo()
    renewed = ensure_web_certificate(tmp_path, []).certificate("web").read_bytes()
    assert renewed != first
    assert ensure_web_certificate(tmp_path, []).certificate("web").read_bytes() == renewed


def test_a_certificate_of_ones_own_is_checked(tmp_path: Path) -> None:
    ours = private_tls(tmp_path / "a", ("base.lab",))
    other = private_tls(tmp_path / "b", ())
    given = given_tls(ours.certificate, ours.key)
    assert "base.lab" in given.names
    assert given.authority is None
    broken = tmp_path / "broken.pem"
    broken.write_text("no certificate")
    for certificate, key, said in (
        (tmp_path / "none.pem", ours.key, "--tls-certificate .* cannot be read"),
        (ours.certificate, tmp_path / "none.key", "--tls-key .* cannot be read"),
        (broken, ours.key, "holds no certificate in PEM"),
        (ours.certificate, broken, "is not the key"),
        (ours.certificate, other.key, "does not fit"),
    ):
        with pytest.raises(UsageError, match=said) as caught:
            given_tls(certificate, key)
        assert "\n" not in str(caught.value)


def test_an_expired_certificate_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "vehicle_link.security.page_authority.WEB_DAYS", 1
    )  # begins and ends a day before
    files = ensure_web_certificate(tmp_path, [])
    with pytest.raises(UsageError, match="and not today"):
        given_tls(files.certificate("web"), files.key("web"))


def test_a_key_locked_by_a_password_is_refused(tmp_path: Path) -> None:
    from cryptography.hazmat.primitives import serialization

    ours = private_tls(tmp_path, ())
    key = serialization.load_pem_private_key(ours.key.read_bytes(), None)
    locked = tmp_path / "locked.key"
    locked.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.BestAvailableEncryption(b"secret"),
        )
    )
    with pytest.raises(UsageError, match="is encrypted"):
        given_tls(ours.certificate, locked)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9", "::1", "localhost"])
def test_loopback_needs_nothing(host: str) -> None:
    assert is_loopback(host)
    check_listen_address(host, has_tls=False, accounts=0)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", ""])
def test_elsewhere_needs_tls_and_an_account(host: str) -> None:
    check_listen_address(host, has_tls=True, accounts=1)
    for has_tls, accounts, said in (
        (False, 1, r"needs TLS \(add --tls\);"),
        (True, 0, r"needs at least one account \(quadlab user add NAME\);"),
        (False, 0, r"add --tls.*quadlab user add"),
    ):
        with pytest.raises(UsageError, match=said):
            check_listen_address(host, has_tls=has_tls, accounts=accounts)


def test_hosts_are_those_we_are_reached_by() -> None:
    hosts = allowed_hosts("https://192.0.2.7:8443", ("Base.lab", "fd00::7"))
    assert hosts == {
        "192.0.2.7:8443",
        "127.0.0.1:8443",
        "localhost:8443",
        "[::1]:8443",
        "base.lab:8443",
        "[fd00::7]:8443",
    }
    assert {"base.lab", "base.lab:443"} <= allowed_hosts("https://base.lab:443")


def test_a_page_on_all_addresses_is_known_by_each() -> None:
    assert "127.0.0.1" in own_names("0.0.0.0")
    assert shown_host("0.0.0.0") not in ("0.0.0.0", "")
    assert own_names("192.0.2.7") == ("192.0.2.7",)
