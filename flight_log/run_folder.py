"""The layout of a run: a folder with the station's log, the vehicle's own logs and both as one.

`station.mcap` is what the station recorded, `vehicle.mcap` (then `vehicle_2.mcap`, …) what the
vehicle itself logged, as it wrote it. `merged.mcap` is made of these (`flight_log.merge`): it can
be deleted and made again. A run of an older version is a single file.
"""

from __future__ import annotations

from pathlib import Path

STATION, VEHICLE, MERGED = "station.mcap", "vehicle.mcap", "merged.mcap"


def station_log(run: Path) -> Path:
    """Return the log that the station recorded: of a single file and of a folder without one
    itself.
    """
    log = run / STATION
    return log if log.exists() else run


def vehicle_logs(run: Path) -> list[Path]:
    """Return the vehicle's own logs that lie in a run's folder, in the order of their names."""
    return sorted(run.glob("vehicle*.mcap"), key=lambda path: (len(path.name), path.name))


def log_of(run: Path) -> Path:
    """Return the file to read of a run: both logs as one where that was made, else the station's
    log, else the vehicle's. A single file is itself, and a folder without any log.
    """
    candidates = [run / MERGED, run / STATION, *vehicle_logs(run)]
    return next((path for path in candidates if path.exists()), run)


def run_bytes(run: Path) -> int:
    """Return the size of a run's logs. Raises OSError."""
    logs = run.glob("*.mcap") if run.is_dir() else [run]
    return sum(path.stat().st_size for path in logs)
