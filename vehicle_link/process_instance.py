"""The instance of a process: a random number made at its start, by which others recognise it."""

from __future__ import annotations

import secrets


def new_instance() -> int:
    """Return a new instance, 1 … 2**64 - 1; 0 means "unknown" in messages."""
    return secrets.randbelow(2**64 - 1) + 1


def short_id(instance: int) -> str:
    """Return six digits, enough for people to tell processes apart."""
    return f"{instance:016x}"[:6]
