"""`quadlab formations OUT`: flights of a formation, as a dataset."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.option_types import Settings
from quadrotor.errors import StorageError, UsageError
from quadrotor.extension import Exporter
from quadrotor.extensions import registry

if TYPE_CHECKING:
    from quadlab.simulated.together import FlownTogether

EXPERIMENT, PARQUET = "formation", "parquet"
FLIGHTS_MAX = 1000
TOPICS = ("truth", "neighbour_bearings", "state", "bearing_pose", "joy", "events")
DESCRIPTION = """# Flights of a formation by bearings

Simulated quadrotors take off at random places, converge to a formation that is held by the
bearings which they measure of each other, hold it, are steered, and land. Made by quadlab.

`flights.json` has a row for each flight: seed, parameters that were set, verdict and figures. The
folder of a flight has a log of each vehicle, like `quad1.mcap`, with all its topics, and of these,
as tables, in `parquet/quad1/`:

- truth: true pose in world axes (z up, m, quaternion), twist in body axes.
- neighbour_bearings: unit vectors to the other vehicles, in body axes. `beacon_ids` are vehicles,
  from 1. `sigma` (rad) is on each of two tangent axes: a bearing b has the covariance
  sigma^2 (I - b b^T).
- state: the vehicle's own estimate, on which it flies.
- bearing_pose: pose from bearings to beacons on the ground, with its covariance, 6 x 6 row by row.
- place_of_NAME: where the vehicle estimates another one by bearings alone: its place in the own yaw
  frame, its yaw less the own, with their covariance, 6 x 6 row by row.
- joy: the velocity and yaw rate that were asked for, as shares of the parameters
  behavior.joy_speed_xy, joy_speed_z and joy_yaw_rate.
- events: what the vehicle told.

`stamp_ns` is the instant of a measurement and `received_ns` that of its arrival, by one clock of
all vehicles. Units are in the metadata of the fields; the schema of each file has all parameters.
"""


@dataclass
class Dataset:
    """Fly a formation several times, and write truth, bearings and covariances as MCAP and
    Parquet."""

    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")]
    """new folder for the flights, and what they are"""
    flights: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """how many, 1 to 1000"""
    vehicles: Annotated[int, tyro.conf.arg(metavar="N")] = 5
    """that fly together, 3 to 8"""
    seed: int = 1
    """of the first flight; each further one has the next"""
    set: Settings = ()
    """set a parameter, as for quadlab fly formation"""

    def run(self) -> int:
        from quadlab.simulated.together import fly_together

        if not 1 <= self.flights <= FLIGHTS_MAX:
            raise UsageError(f"--flights {self.flights}; allowed are 1 to {FLIGHTS_MAX}")
        if self.out.exists():
            raise UsageError(f"{self.out} exists; give a new folder, nothing is overwritten")
        if PARQUET not in registry().offers(Exporter):
            raise UsageError("the tables are written by the extension export, which is missing")
        rows = []
        for number in range(self.flights):
            done = fly_together(
                EXPERIMENT, self.vehicles, seed=self.seed + number, words=self.set, out=self.out
            )
            for log in done.logs.values():
                write_tables(log, done.folder / PARQUET / log.stem)
            rows.append(self._row(done, self.seed + number))
            print(f"{done.folder.name}: {done.verdict}{f' ({done.reason})' if done.reason else ''}")
            try:
                (self.out / "README.md").write_text(DESCRIPTION, encoding="utf-8")
                (self.out / "flights.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
            except OSError as error:
                raise StorageError(f"cannot write into {self.out}: {error.strerror}") from error
        passed = sum(row["verdict"] == "passed" for row in rows)
        print(f"{passed} of {len(rows)} flights passed; {self.out}")
        return 0 if passed == len(rows) else 1

    def _row(self, done: FlownTogether, seed: int) -> dict[str, object]:
        return {
            "folder": done.folder.name,
            "seed": seed,
            "vehicles": self.vehicles,
            "set": list(self.set),
            "verdict": done.verdict,
            "reason": done.reason,
            "figures": done.metrics,
        }


def write_tables(log: Path, folder: Path) -> list[Path]:
    """Write those of TOPICS that a log has, and the places estimated of others, as Parquet into a
    new folder. Raises LogFormatError, StorageError.
    """
    from console.log_tables import Tables
    from extensions.formations.localiser import TOPIC as ESTIMATED
    from flight_log.summary import summarize

    there = summarize(log).topics
    topics = [
        one
        for one in there
        if (name := one.rpartition("/")[2]) in TOPICS or name.startswith(ESTIMATED)
    ]
    tables = Tables(log, topics)
    try:
        folder.mkdir(parents=True)
        files = registry().offers(Exporter)[PARQUET].load()(folder, log.stem, tables.run)
        try:
            for piece in tables:
                files.write(piece)
            return list(files.finish())
        except BaseException:
            files.discard()
            raise
    except OSError as error:
        raise StorageError(f"cannot write into {folder}: {error.strerror}") from error
