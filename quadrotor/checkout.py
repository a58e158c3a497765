"""The root folder of this checkout of quadlab, from which helper programs are started."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
