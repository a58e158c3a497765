"""Design tokens, and the theme that a browser's user has chosen.

A page that follows the system's theme needs nothing from the server: `core/tokens.css` has both.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextvars import ContextVar
from pathlib import Path

from starlette.requests import HTTPConnection

from quadrotor.extension import PageDocument
from quadrotor.extensions import registry

COOKIE = "quadlab_theme"
"""Name of the cookie, which `static/core/theme.js` writes."""
CHOICES = ("light", "dark")
TOKENS = (Path(__file__).parent / "static/core/tokens.css").read_text(encoding="utf-8")
"""Colours and sizes, for the pages that load no stylesheet."""

_chosen: ContextVar[str] = ContextVar("chosen", default="")


def follow_choice(came: HTTPConnection) -> None:
    """Make the pages of this request's context in the theme that its browser has stored."""
    found = came.cookies.get(COOKIE, "")
    _chosen.set(found if found in CHOICES else "")


def html_tag(documents: Iterable[str] | None = None) -> str:
    """Return the opening tag of a page, with the chosen theme, if any, and the names of the
    extensions' documents that are there (`static/core/vehicle_path.js`); None: all they offer.
    """
    chosen, there = (
        _chosen.get(),
        registry().offers(PageDocument) if documents is None else documents,
    )
    theme = f' data-theme="{chosen}"' if chosen else ""
    return f'<html lang="en"{theme} data-documents="{" ".join(there)}">'
