"""The layout of a run: a folder with the station's log, the vehicle's own logs and the merged log.

`station.mcap` is what the station recorded, `vehicle.mcap` (then `vehicle_2.mcap`, …) what the
vehicle itself logged, unchanged. `merged.mcap` is made from these (`flight_log.merge`): it can be
deleted and made again. A run of an older version is a single file.
"""

from __future__ import annotations

from pathlib import Path

RUNS = "runs"
"""Folder of all runs in the data folder."""
IMPORTED = "import"
"""Value of `recorder` in the metadata of a run that another system recorded."""
STATION, VEHICLE, MERGED = "station.mcap", "vehicle.mcap", "merged.mcap"


def station_log(run: Path) -> Path:
    """Return the log that the station recorded; for a single file, and for a folder without such a
    log, the path itself.
    """
    log = run / STATION
    return log if log.exists() else run


def vehicle_logs(run: Path) -> list[Path]:
    """Return the vehicle's own logs in a run's folder, in the order of their names."""
    return sorted(run.glob("vehicle*.mcap"), key=lambda path: (len(path.name), path.name))


def log_of(run: Path) -> Path:
    """Return the file to read of a run: the merged log if there is one, else the station's log,
    else the vehicle's. For a single file, and for a folder without any log, return the path itself.
    """
    candidates = [run / MERGED, run / STATION, *vehicle_logs(run)]
    return next((path for path in candidates if path.exists()), run)


def run_bytes(run: Path) -> int:
    """Return the size of a run's logs. Raises OSError."""
    logs = run.glob("*.mcap") if run.is_dir() else [run]
    return sum(path.stat().st_size for path in logs)
