"""Catalogue runs without files."""

from __future__ import annotations

from console.catalogue.tables import RunEntry


def run_entry(name: str, **fields: object) -> RunEntry:
    """Return a complete run of ada's with quad1, changed by `fields`."""
    values: dict[str, object] = {
        "id": name,
        "vehicle": "quad1",
        "start_ns": 1_700_000_000_000_000_000,
        "duration": 1.5,
        "file": f"{name}.mcap",
        "bytes": 10,
        "messages": 3,
        "operator": "ada",
        "complete": True,
        "recovered": False,
        "problem": "",
        "notes": "",
    }
    return RunEntry(**{**values, **fields})  # type: ignore[arg-type]
