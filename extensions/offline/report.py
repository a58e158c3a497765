"""The rows of a replay, for the terminal, CSV and JSON, and a plot of the position errors."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.plots import require_matplotlib
from extensions.offline.lines import Run
from extensions.offline.run import Replayed
from extensions.offline.window import Window
from quadlab.recording.errors import Consistency, Errors, Truth, errors, of_errors
from quadlab.recording.log import Recording
from quadrotor.errors import StorageError, UsageError
from quadrotor.records import Array, Stamps

RECORDED = "recorded state"

COLUMNS = (
    ("position mm", "position_rms_m", 1e3, ".1f"),
    ("max", "position_max_m", 1e3, ".1f"),
    ("velocity mm/s", "velocity_rms_m_s", 1e3, ".1f"),
    ("max", "velocity_max_m_s", 1e3, ".1f"),
    ("attitude deg", "attitude_rms_deg", 1.0, ".2f"),
    ("max", "attitude_max_deg", 1.0, ".2f"),
    ("measured", "measurements", 1.0, ".0f"),
    ("rejected", "rejected_share", 1.0, ".1%"),
    ("NIS", "nis", 1.0, ".2f"),
    ("expected", "nis_low nis_high", 1.0, ".2f"),
    ("NEES", "nees", 1.0, ".2f"),
    ("expected", "nees_low nees_high", 1.0, ".2f"),
    ("inside", "nees_inside_share", 1.0, ".0%"),
    ("ms per s", "processor_s_per_s", 1e3, ".0f"),
)
"""Columns of the table: heading, values, factor to the heading's unit, format."""

Value = float | int | str | None


@dataclass(frozen=True)
class Row:
    """One run, or the recorded state that was flown on."""

    label: str
    measurements: str
    values: dict[str, Value]
    errors: Errors
    deviation_ns: Stamps  # when the estimator stated its position deviation
    deviation: Array  # m
    note: str = ""


def recorded_row(recording: Recording, truth: Truth, window: Window) -> Row:
    """Return the row of the recorded state that was flown on."""
    inside = _inside(recording.state_ns, window)
    found = errors(truth, recording.state_ns[inside], recording.state[inside])
    values: dict[str, Value] = {
        **found.metrics(),
        "measurements": None,
        "rejected_share": None,
        **_consistency("nis", None),
        **_consistency("nees", None),
        "processor_s_per_s": None,
    }
    return Row(RECORDED, "", values, found, np.zeros(0, np.int64), np.zeros(0))


def run_row(
    recording: Recording, truth: Truth, window: Window, run: Run, replayed: Replayed
) -> Row:
    """Return the errors of a run from its start on, with a note if it started late or never."""
    stamps = recording.imu["stamp_ns"]
    started_ns = replayed.started_ns
    inside = _inside(stamps, window)
    inside &= stamps > started_ns if started_ns is not None else np.zeros(len(stamps), bool)
    found = errors(truth, stamps[inside], replayed.states[inside])
    count, rejected, nis = replayed.within(window.start_ns, window.end_ns)
    nees = of_errors(truth, replayed.posteriors_within(window.start_ns, window.end_ns))
    duration = 1e-9 * float(stamps[-1] - stamps[0])
    values: dict[str, Value] = {
        **found.metrics(),
        "measurements": count,
        "rejected_share": rejected,
        **_consistency("nis", nis),
        **_consistency("nees", nees),
        "processor_s_per_s": replayed.processor / duration if duration > 0.0 else None,
    }
    note = ""
    if started_ns is None:
        note = f"never started: {replayed.complaint or 'no measurement was received'}"
    elif started_ns > window.start_ns:
        note = f"started at {recording.seconds(started_ns):.2f} s, compared from there on"
    for name, held in replayed.held().items():
        note += f"{'; ' if note else ''}{name} held the bias for {held:.1f} s: raise it"
    unsound = int((~np.isfinite(found.position)).sum())
    if unsound:
        note = f"{unsound} of {len(found.position)} estimates are not finite"
    return Row(run.label, run.measurements, values, found, *replayed.position_deviations(), note)


def print_table(rows: list[Row]) -> None:
    """Print the rows aligned; lengths in mm, angles in degrees."""
    lines: list[tuple[str, ...]] = [
        ("run", "on", *(column[0] for column in COLUMNS)),
        *map(_cells, rows),
    ]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        texts = [f"{text:<{width}}" for text, width in zip(line[:2], widths[:2], strict=True)]
        numbers = [f"{text:>{width}}" for text, width in zip(line[2:], widths[2:], strict=True)]
        print("  ".join([*texts, *numbers]).rstrip())
    for row in rows:
        if row.note:
            print(f"  {row.label}: {row.note}")


def as_json(recording: Recording, truth: str, window: Window, rows: list[Row]) -> str:
    """Return one line of JSON; units as in the names: SI and degrees."""
    start, end = (float(recording.seconds(one)) for one in (window.start_ns, window.end_ns))
    report = {
        "log": str(recording.path),
        "vehicle": recording.vehicle,
        "truth": truth,
        "window": {"from_s": round(start, 9), "to_s": round(end, 9), "found": window.found},
        "runs": [
            {"run": row.label, "on": row.measurements or None, **row.values}
            | ({"note": row.note} if row.note else {})
            for row in rows
        ],
    }
    return json.dumps(report)


def write_csv(path: Path, rows: list[Row]) -> None:
    """Write the table in full precision. Raises StorageError."""
    try:
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["run", "on", *rows[0].values])
            for row in rows:
                cells = ("" if value is None else value for value in row.values.values())
                writer.writerow([row.label, row.measurements, *cells])
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}") from error


def _inside(stamps_ns: Stamps, window: Window) -> npt.NDArray[np.bool_]:
    inside: npt.NDArray[np.bool_] = (stamps_ns >= window.start_ns) & (stamps_ns <= window.end_ns)
    return inside


def _cells(row: Row) -> tuple[str, ...]:
    cells = [row.label, row.measurements or "-"]
    for _, names, factor, style in COLUMNS:
        values = [row.values[name] for name in names.split()]
        known = [f"{factor * float(value):{style}}" for value in values if value is not None]
        cells.append("–".join(known) if len(known) == len(values) else "-")
    return tuple(cells)


def _consistency(name: str, found: Consistency | None) -> dict[str, Value]:
    values: dict[str, Value] = {
        name: found.mean if found else None,
        f"{name}_low": found.low if found else None,
        f"{name}_high": found.high if found else None,
    }
    if name != "nis":
        values[f"{name}_inside_share"] = found.inside if found else None
    return values


# Okabe and Ito's colours, which colour-blind people can distinguish too.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
STYLES = ("-", "-.", ":")
SPREAD = 10.0
"""Ratio of the largest to the smallest rms above which the axis is logarithmic."""


def check_plot(path: Path) -> None:
    """Check the plot's file before the replay begins. Raises UsageError."""
    require_matplotlib("--plot")
    from matplotlib.backend_bases import FigureCanvasBase

    ending = path.suffix.lstrip(".").lower()
    if ending not in FigureCanvasBase.filetypes:
        raise UsageError(f"--plot {path}: no picture ends in {path.suffix!r}; try .png, .svg, .pdf")


def draw(path: Path, recording: Recording, window: Window, rows: list[Row]) -> None:
    """Draw errors as solid lines, three standard deviations stated by the estimator as dashed ones.
    Raises StorageError.
    """
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(10.0, 6.0), layout="constrained")
    replays = [row for row in rows if row.label != RECORDED]
    for row in rows:
        time, error = recording.seconds(row.errors.stamps_ns), 1e3 * row.errors.position
        if row.label == RECORDED:
            axes.plot(time, error, color="#999999", linewidth=1.0, label=f"{RECORDED}{_rms(row)}")
            continue
        k = next(k for k, one in enumerate(replays) if one is row)
        color, style = COLORS[k % len(COLORS)], STYLES[k // len(COLORS) % len(STYLES)]
        label = f"{row.label}, {row.measurements}{_rms(row)}"
        axes.plot(time, error, style, color=color, linewidth=1.0, label=label)
        inside = (row.deviation_ns >= window.start_ns) & (row.deviation_ns <= window.end_ns)
        if inside.any():
            time, bound = recording.seconds(row.deviation_ns[inside]), 3e3 * row.deviation[inside]
            axes.step(time, bound, "--", where="post", color=color, linewidth=1.2, alpha=0.7)
    if any(len(row.deviation) for row in replays):
        axes.plot([], [], "--", color="#666666", label="3σ by the estimator's own covariance")
    sizes = [1e3 * float(rms) for row in rows if (rms := row.values["position_rms_m"])]
    if sizes and max(sizes) > SPREAD * min(sizes):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.1 * min(sizes))
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlim(recording.seconds(window.start_ns), recording.seconds(window.end_ns))
    axes.set_xlabel("time (s)")
    axes.set_ylabel("position error (mm)")
    axes.set_title(recording.path.name, fontsize=10)
    axes.grid(True, alpha=0.3)
    figure.legend(frameon=False, fontsize=8, loc="outside lower center")
    try:
        figure.savefig(path, dpi=120)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}") from error
    finally:
        pyplot.close(figure)


def _rms(row: Row) -> str:
    rms = row.values["position_rms_m"]
    return ", no estimate" if rms is None else f", {1e3 * float(rms):.1f} mm rms"
