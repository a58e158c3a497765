"""Options of `web` and `up`: the address of the page and its certificate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.option_types import File, Flag
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from web.access.tls import Tls


@dataclass
class PageOptions:
    """Options of the page, shared by `quadlab up` and `quadlab web`."""

    host: Annotated[str, tyro.conf.arg(metavar="ADDRESS")] = "127.0.0.1"
    """address to listen on; others than loopback need TLS and an account"""
    tls: Flag = False
    """serve https, with a certificate of the page's own authority"""
    tls_certificate: File = None
    """serve https with this certificate (PEM)"""
    tls_key: File = None
    """… and its key (PEM)"""

    @property
    def has_tls(self) -> bool:
        return self.tls or self.tls_certificate is not None or self.tls_key is not None

    def check_page(self, data: Path) -> Tls | None:
        """Return the page's certificate, if any. Raises UsageError, StorageError or LinkError."""
        from web.access.listen_address import check_listen_address, is_loopback

        if (self.tls_certificate is None) != (self.tls_key is None):
            raise UsageError("--tls-certificate and --tls-key go together; give both or neither")
        accounts = 0
        if not is_loopback(self.host):
            from web.access.database import count_accounts

            accounts = count_accounts(data / "web")
        check_listen_address(self.host, has_tls=self.has_tls, accounts=accounts)
        return self._certificate(data) if self.has_tls else None

    def words(self) -> list[str]:
        """Return these options as words of a command line."""
        out = ["--host", self.host]
        if self.tls_certificate is not None and self.tls_key is not None:
            certificate, key = self.tls_certificate.absolute(), self.tls_key.absolute()
            out += ["--tls-certificate", str(certificate), "--tls-key", str(key)]
        elif self.tls:
            out.append("--tls")
        return out

    def _certificate(self, data: Path) -> Tls:
        from web.access.tls import given_tls, own_names, private_tls

        if self.tls_certificate is not None and self.tls_key is not None:
            return given_tls(self.tls_certificate, self.tls_key)
        return private_tls(data, own_names(self.host))


def say_authority(tls: Tls) -> None:
    """Print where the authority's certificate is and what to do with it, once at the start."""
    if tls.authority is not None:
        print(
            f"https with a certificate of the page's own authority. Trust it once in each "
            f"browser (settings, certificates, authorities, import):\n  {tls.authority}\n"
            "It may be passed on; ca.key next to it must not. It permits private networks and "
            "this computer's names alone; for a new public name or address it is made again.",
            flush=True,
        )
