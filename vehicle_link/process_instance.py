"""The instance of a process, which tells who is at the other end: a random number it made when it
started.
"""

from __future__ import annotations

import secrets


def new_instance() -> int:
    """Return a new instance, 1 … 2**64 - 1; 0 means "not known" in messages."""
    return secrets.randbelow(2**64 - 1) + 1


def spoken(instance: int) -> str:
    """Return six digits, enough to tell processes apart in a line for people."""
    return f"{instance:016x}"[:6]
