"""A sign-in link for one more browser, as a picture for a telephone where one can reach it."""

from __future__ import annotations

from urllib.parse import urlsplit

import segno

from web.access.listen_address import is_loopback


def link_and_code(url: str) -> dict[str, str | bool]:
    """Return a link, whether it opens on this computer only, and else its QR code (a data URL)."""
    here_only = is_loopback(urlsplit(url).hostname or "")
    picture = "" if here_only else segno.make(url).png_data_uri(scale=6, border=4)
    return {"url": url, "here_only": here_only, "picture": picture}
