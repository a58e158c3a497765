"""The shards of a campaign joined into one table."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from extensions.campaigns.beginning import LOGS
from extensions.campaigns.folder import CampaignFolder
from quadrotor.errors import UsageError, os_errors


def merge(paths: Sequence[Path]) -> list[str]:
    """Join the rows and logs of shards into the first folder; return lines for people.

    Raises UsageError for folders of different campaigns, StorageError.
    """
    folders = [CampaignFolder(path) for path in dict.fromkeys(one.resolve() for one in paths)]
    first, *others = folders
    for one in others:
        for name in ("plan", "software"):
            if one.record[name] != first.record[name]:
                raise UsageError(
                    f"{one.path} is of another {name} than {first.path} ({one.record[name]}, "
                    f"{first.record[name]}): only shards of one campaign are merged"
                )
    with ExitStack() as held:
        for one in folders:
            held.enter_context(one.owned())
            one.mend()
        for number, one in enumerate(others, 1):
            _take(first, one, number)
        is_whole = first.finish()
    flown = first.count() if is_whole else int(first.done().sum())
    lines = [f"{flown} of {first.flights} flights in {first.path}"]
    if not is_whole:
        lines.append(f"quadlab campaign resume {first.path} flies the others")
    return lines


def _take(into: CampaignFolder, other: CampaignFolder, number: int) -> None:
    for part in sorted(other.rows.glob("*.parquet")):
        _copy(part, into.rows / f"merged{number}_{part.name}")
    for log in sorted((other.path / LOGS).glob("*.mcap")):
        (into.path / LOGS).mkdir(exist_ok=True)
        _copy(log, into.path / LOGS / log.name)


def _copy(source: Path, place: Path) -> None:
    if place.exists():  # of an earlier merge
        return
    new = place.with_name(f"{place.name}.new")
    with os_errors(lambda why: f"{place} cannot be written ({why})"):
        shutil.copyfile(source, new)
        new.replace(place)
