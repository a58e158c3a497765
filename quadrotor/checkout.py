"""The place of this checkout of quadlab: helper programs are started from its root folder."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
