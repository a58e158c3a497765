"""`--beacons FILE` of the commands that emulate bearings."""

from __future__ import annotations

from pathlib import Path

from quadrotor.errors import MeasurementError, UsageError


def beacon_words(file: Path | None) -> list[str]:
    """Return the `--set` words for the file's layout of beacons. Raises UsageError with line and
    column.
    """
    if file is None:
        return []
    from bearing_sim.beacons import format_layout, load_beacons

    try:
        return [f"bearings.layout={format_layout(load_beacons(file))}"]
    except MeasurementError as error:
        raise UsageError(f"--beacons: {error}") from None
