"""A recorded run for scripts and notebooks: topics as tables, errors, parameters and events.

import quadlab

run = quadlab.open("20261124T134250Z_quad1")      # a run of the data folder, a folder or a file
state = run["state"]                              # only this topic is read
state["pose.pose.position.z"]                     # a numpy array, (N,)
state.window(5.0, 10.0).pandas()
run.errors().metrics()                            # against the truth, where it was logged
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from console.log_tables import Tables
from flight_log.run_folder import log_of
from flight_log.summary import LogSummary, summarize
from quadrotor.errors import StorageError, UsageError
from quadrotor.parameter_description import ParameterValue

if TYPE_CHECKING:
    from console.experiments.client import Result
    from console.reports.run_log import Line, RunLog
    from quadlab.recording.errors import Errors
    from quadlab.recording.log import Recording

Array = npt.NDArray[Any]
TIMES = ("time", "stamp_ns", "received_ns")


def open(run: str | Path, data: Path | None = None) -> Run:
    """Return a run: a file, a run's folder, or the name of a run in the data folder.

    Args:
        data: the data folder; None for the default one.

    Raises StorageError when there is no such run, LogFormatError when the file is not a log.
    """
    from quadlab.data_folder import open_data_folder

    path = Path(run).expanduser()
    if not path.exists():
        runs = open_data_folder(data) / "runs"
        path = next((p for p in (runs / path, runs / f"{path}.mcap") if p.exists()), path)
        if not path.exists():
            known = sorted((p.stem for p in runs.glob("*")), reverse=True)[:3]
            newest = f"; the newest runs of {runs} are {', '.join(known)}" if known else ""
            raise StorageError(f"there is no run {str(run)!r}, as a file or in {runs}{newest}")
    return Run(log_of(path))


def fly(
    experiment: str = "figure_eight",
    *,
    seed: int = 1,
    set: Mapping[str, ParameterValue] | None = None,
    out: Path | None = None,
    plugins: Path | None = None,
) -> Run:
    """Fly an experiment on the simulated vehicle and return its run, with the result.

    Args:
        experiment: a name, or a Python file. seed: of all noise. set: parameters by name.
        out: folder of the log; None: flights in the data folder. plugins: folder of control laws.

    Raises QuadlabError with the messages of `quadlab fly`.
    """
    from quadlab.simulated import experiment as simulated

    words = [f"{name}={value}" for name, value in (set or {}).items()]
    chosen = simulated.chosen(experiment)
    done = simulated.fly(chosen, seed=seed, words=words, out=out, plugins=plugins)
    return Run(done.path, done.result)


class Run:
    """One run. A topic is read on its first use, and kept in memory.

    Args:
        path: the log's file.
        result: verdict and figures of a flight that has just been flown.

    Raises StorageError, LogFormatError.
    """

    def __init__(self, path: Path, result: Result | None = None) -> None:
        self.path, self.result = path, result
        self._summary: LogSummary = summarize(path)
        self._tables: dict[str, Table] = {}
        self._names = {name.strip("/").split("/", 1)[-1]: name for name in self._summary.topics}

    def __repr__(self) -> str:
        return f"Run({self.path.name}, {self.duration:.1f} s, {len(self.topics)} topics)"

    @property
    def topics(self) -> tuple[str, ...]:
        """Return the names of the topics, without the vehicle's namespace."""
        return tuple(sorted(self._names))

    @property
    def duration(self) -> float:
        """Return the seconds from the first to the last message."""
        return self._summary.duration

    @property
    def metadata(self) -> Mapping[str, str]:
        """Return the recorder's metadata: run, vehicle, versions of the software."""
        return self._summary.run

    def __getitem__(self, topic: str) -> Table:
        """Return a topic as a table. Raises UsageError if the log has no such topic."""
        if topic not in self._tables:
            found = next(Tables(self.path, [topic]).whole(), None)
            if found is None:
                raise UsageError(f"topic {topic} of {self.path.name} has no messages")
            self._tables[topic] = Table(found.table)
        return self._tables[topic]

    def __contains__(self, topic: object) -> bool:
        return topic in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self.topics)

    @cached_property
    def events(self) -> list[Line]:
        """Return events, marks and changed parameters, each with its time in s."""
        return self._report.lines

    @cached_property
    def parameters(self) -> dict[str, ParameterValue]:
        """Return the parameters at the start; `run.events` has their changes."""
        return self._report.parameters

    @cached_property
    def calibrations(self) -> Any:
        """Return the calibrations that were in force; None if the log has none attached."""
        return self._report.json_attachment("calibrations.json")

    def errors(self) -> Errors:
        """Return the errors of the estimated state against the truth, at each of its samples.

        Raises UsageError for a run without truth.
        """
        from quadlab.recording.errors import Truth, errors

        recording = self.recording
        if len(recording.truth_ns) < 2:
            raise UsageError(f"{self.path.name} has no truth to compare with")
        truth = Truth(recording.truth_ns, recording.truth)
        return errors(truth, recording.state_ns, recording.state)

    @cached_property
    def recording(self) -> Recording:
        """Return the samples and measurements that `quadlab replay` feeds to estimators."""
        from quadlab.recording.log import read_recording

        return read_recording(self.path)

    @cached_property
    def _report(self) -> RunLog:
        from console.reports.run_log import read_run

        return read_run(self.path)


@dataclass(frozen=True)
class Table:
    """A topic's messages: a row for each message, a column for each number and text.

    `time` is in s since the log's first message, `stamp_ns` is when the message was valid on its
    source's clock, `received_ns` when it was recorded.

    Attributes:
        arrow: a pyarrow.Table; the units are in the metadata of its fields.
    """

    arrow: Any

    def __len__(self) -> int:
        return int(self.arrow.num_rows)

    def __repr__(self) -> str:
        return f"Table({len(self)} rows: {', '.join(self.columns)})"

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(self.arrow.column_names)

    @property
    def units(self) -> dict[str, str]:
        """Return the unit of each column that has one."""
        fields = ((f.name, f.metadata or {}) for f in self.arrow.schema)
        return {name: known[b"unit"].decode() for name, known in fields if b"unit" in known}

    def __getitem__(self, column: str) -> Array:
        """Return a column as an array (N,). Raises UsageError if there is no such column."""
        if column not in self.columns:
            raise UsageError(f"no column {column!r}; there are {', '.join(self.columns)}")
        found: Array = self.arrow[column].to_numpy()
        return found

    def numpy(self, *columns: str) -> Array:
        """Return columns as an array, (N, M)."""
        return np.stack([self[column] for column in columns], axis=1)

    def pandas(self) -> Any:
        """Return a pandas.DataFrame with `time` as index. Raises UsageError without pandas."""
        _require("pandas")
        return self.arrow.to_pandas().set_index("time")

    def polars(self) -> Any:
        """Return a polars.DataFrame. Raises UsageError without polars."""
        return _require("polars").from_arrow(self.arrow)

    def window(self, begin: float, end: float) -> Table:
        """Return the rows from `begin` to `end` (s). Raises UsageError for an empty range."""
        if not begin < end:
            raise UsageError(f"from {begin:g} to {end:g} s is not a range of time")
        time = self["time"]
        return Table(self.arrow.filter((time >= begin) & (time <= end)))

    def at(self, times: npt.ArrayLike) -> Table:
        """Return the table at these times (M,) (s): numbers interpolated linearly, texts and
        integers from the last row before; NaN before the first and after the last row.
        """
        import pyarrow as pa

        wanted, time = np.asarray(times, float), self["time"]
        if wanted.ndim != 1 or not len(time):
            raise UsageError("times must be one row of numbers, and the table must have rows")
        outside = (wanted < time[0]) | (wanted > time[-1])
        last = np.clip(np.searchsorted(time, wanted, side="right") - 1, 0, None)
        joined: dict[str, Array] = {}
        for name in self.columns:
            values = self[name]
            if name == "time":
                joined[name] = wanted
            elif values.dtype.kind == "f":
                joined[name] = np.where(outside, np.nan, np.interp(wanted, time, values))
            else:
                joined[name] = values[last]
        return Table(pa.table(joined, schema=self.arrow.schema))


def _require(name: str) -> Any:
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError:
        raise UsageError(f"this needs {name}: pip install {name}") from None
