"""The beginning of a campaign's folder: its plan, and what it is flown with."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path

import msgspec

from console.atomic_file import replacing
from extensions.campaigns.design import Cells
from extensions.campaigns.plan import OWN, PlanFile
from flight_log.provenance import provenance, revision
from quadrotor.checkout import PACKAGES, PREFIX, ROOT
from quadrotor.errors import StorageError, os_errors
from quadrotor.json_object import JsonObject

PLAN, RECORD, ROWS, LOGS = "plan.toml", "campaign.json", "rows", "logs"
LOCK = "run.lock"
PROTOCOL = 1
"""Version of the folder's files."""


@cache
def software() -> dict[str, str]:
    """Return the software that the rows depend on besides the plan: quadlab, by a hash of its
    sources.
    """
    made = hashlib.sha256()
    for folder in [ROOT] if PREFIX else [ROOT / name for name in (*PACKAGES, "quadlab")]:
        for one in sorted(folder.rglob("*.py")):
            if "tests" not in one.parts:
                made.update(one.read_bytes())
    return {"quadlab": version("quadlab"), "sources": made.hexdigest()[:16]}


MADE = {PLAN, f"{PLAN}.new", f"{RECORD}.new", ROWS, OWN, LOCK}
"""Files that a run leaves when it is killed at its very beginning."""


def make(path: Path, file: PlanFile, cells: Cells) -> None:
    """Make the folder; the record is written last."""
    path.mkdir(parents=True, exist_ok=True)
    (path / ROWS).mkdir(exist_ok=True)
    file.keep_files(path)
    with replacing(path / PLAN) as new:
        new.write_text(file.text)
    record = {
        "protocol": PROTOCOL,
        "plan": file.identity,
        "experiment": file.plan.experiment,
        "flights": cells.flights,
        "cells": cells.number,
        "software": software(),
        "revision": revision(),
        "versions": json.loads(provenance()["versions"]),
        "machine": {
            "host": platform.node(),
            "system": platform.platform(),
            "processor": platform.machine(),
            "processors": os.cpu_count(),
        },
    }
    write_record(path, record)


def write_record(path: Path, record: Mapping[str, object]) -> None:
    with replacing(path / RECORD) as new:
        new.write_text(json.dumps(record, indent=1) + "\n")


def read_record(path: Path) -> JsonObject:
    """Return the record that was written at the beginning of a campaign. Raises StorageError for a
    folder without one.
    """
    with os_errors(lambda why: f"{path} is no campaign ({why}: {RECORD}); give its folder"):
        data = (path / RECORD).read_bytes()
    try:
        return msgspec.json.decode(data, type=dict)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise StorageError(f"{path / RECORD} is damaged ({error}); run its plan again") from None
