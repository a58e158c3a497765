"""Addresses of this computer."""

from __future__ import annotations

LOOPBACK = "127.0.0.1"
EVERYWHERE = "0.0.0.0"
"""Address to listen on that stands for every one of this computer."""
