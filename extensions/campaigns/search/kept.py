"""The trials of a search on disk: what its sampler has proposed, and whether it is over."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from console.atomic_file import replacing
from extensions.campaigns.factors import Value
from quadrotor.errors import StorageError, UsageError, os_errors

NAME = "trials.json"


@dataclass(frozen=True)
class Kept:
    """The trials that were proposed so far, in their order."""

    trials: list[dict[str, Value]] = field(default_factory=list)
    is_over: bool = False


def read_trials(folder: Path) -> Kept:
    """Return the trials of a campaign's folder; none if it has no search. Raises StorageError."""
    place = folder / NAME
    try:
        return msgspec.json.decode(place.read_bytes(), type=Kept) if place.exists() else Kept()
    except msgspec.DecodeError as error:
        raise StorageError(f"{place} is damaged ({error}); run its plan again") from None


def keep_trials(
    folder: Path,
    known: dict[int, dict[str, Value]],
    proposed: Mapping[int, dict[str, Value]],
    *,
    is_over: bool = False,
) -> None:
    """Add proposed trials to the known trials, and store all of them.

    Raises UsageError when they differ from those kept before, StorageError.
    """
    for number, values in proposed.items():
        if known.setdefault(number, values) != values:
            raise UsageError(
                f"trial {number} of {folder} was {known[number]}, and now its sampler proposes "
                f"{values}: it was begun with another Optuna; begin another campaign"
            )
    place = folder / NAME
    with os_errors(lambda why: f"{place} cannot be written ({why})"), replacing(place) as new:
        kept = {"trials": [known[k] for k in sorted(known)], "is_over": is_over}
        new.write_text(json.dumps(kept, indent=1) + "\n")
