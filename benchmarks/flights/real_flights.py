"""Estimators over recorded flights of real vehicles from a given folder.

Nothing is downloaded: docs/importing.md names public sets, the files of them that are read, and
their licences. Each flight is imported, then each estimator is run as `quadlab replay` does, on
poses and on bearings generated from the truth, and compared with the truth; so are the error-state
filter on recorded sweeps (with the base stations at their documented places, and where a survey
finds them) and the vehicle's own estimate if the log has one.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from estimation import registry
from estimation.calibration.motion import best_turn
from extensions.importers.importing import NewRun, read_flight
from extensions.offline.lines import plan_runs
from extensions.offline.measurements import MeasurementStore
from extensions.offline.report import Value, recorded_row, run_row
from extensions.offline.run import replay
from extensions.offline.survey import survey_stations
from extensions.offline.window import Window
from quadlab.recording.errors import Truth
from quadlab.recording.log import Recording, read_recording
from quadrotor.errors import QuadlabError
from quadrotor.records import Record, Stamps

BY_ENDING = {".hdf5": "blackbird", ".h5": "blackbird", ".ulg": "ulog"}
"""Mapping, by the ending, of files without their own."""
SEEDS = 8, 2, 1  # of each size
"""Number of noise draws for generated data: one draw of bearings is 10 to 20 % off in 30 s."""
POSES = ("tracker.rate=100", "tracker.position_noise=0.0015", "tracker.attitude_noise=0.3")
BEARINGS = ("bearings.rate=30", "bearings.sigma=1.5")
SETTLE_NS = 2_000_000_000
"""Time, in ns, after which errors count: an estimator begins at rest, but these logs in flight."""
HIDDEN_NS, AGAIN_NS = 250_000_000, 1_000_000_000
"""Time in ns without sweeps from which no base station counts as in view, and time after it that
is left out, too."""
SHIFTS_NS = range(-100_000_000, 100_000_001, 5_000_000)
"""Shifts of a clock, in ns, that are tried."""
LIMITS = {
    ("blackbird", "poses"): {
        "position mm": 3.0,
        "velocity mm/s": 30.0,
        "attitude deg": 0.5,
        "refused %": 2.0,
    },
    ("blackbird", "bearings"): {"position mm": 45.0, "velocity mm/s": 60.0},
    ("crazyflie", "sweeps"): {"position mm": 15.0},
}
"""Limits of the error-state filter, by vehicle and measurement."""


def run(size: Size = Size.FULL, *, data: Path | None = None) -> Report:
    """Import and evaluate all flights of a folder; one of each kind unless the size is full."""
    report = Report(
        "real_flights",
        "Estimators on recorded flights of real vehicles",
        [
            f"flights of {data}, each from {SETTLE_NS / 1e9:g} s after its first sample on",
            f"poses: {', '.join(POSES)}, made of the truth",
            f"bearings: {', '.join(BEARINGS)}, of 4 beacons around the area flown, of the truth",
            "sweeps of Lighthouse base stations as recorded",
            "base stations surveyed: where `quadlab replay --survey` finds them without the truth",
            f"noise of poses and bearings: seeds 1 to {size.of(*SEEDS)} together",
            "other settings are this version's defaults; errors are rms",
        ],
    )
    if data is None or not data.is_dir():
        report.notes.append(
            "nothing was run: --data FOLDER names the folder with recorded flights "
            "(docs/importing.md says which); nothing is downloaded"
        )
        return report
    seen: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        for number, (path, mapping, truth) in enumerate(flights(data)):
            if size is not Size.FULL and f"{mapping}" in seen:
                continue
            seen.add(f"{mapping}")
            name = str(path.relative_to(data))
            try:
                imported = read_flight(path, mapping, truth=truth)
                log = NewRun(imported, path).write(Path(folder), f"flight{number}")
                seeds = range(1, size.of(*SEEDS) + 1)
                _judge(report, name, imported.vehicle, read_recording(log), seeds)
            except QuadlabError as error:
                report.notes.append(f"{name}: not judged: {error}")
    if not seen:
        report.notes.append(f"nothing was run: {data} has no flight that is known here")
    return report


def flights(data: Path) -> Iterator[tuple[Path, str | None, Path | None]]:
    """Yield each flight of a folder, its mapping and the file of its truth.

    The mapping is FILE.toml next to it, else by its ending; the truth is mocapNN.npy next to a
    Crazyflie's logNN.
    """
    for path in sorted(data.rglob("*")):
        own = path.with_name(f"{path.name}.toml")
        if own.is_file():
            yield path, str(own), None
        elif path.is_file() and path.suffix in BY_ENDING:
            yield path, BY_ENDING[path.suffix], None
        elif path.is_file() and re.fullmatch(r"log\d+", path.name):
            mocap = path.with_name(f"{path.name.replace('log', 'mocap')}.npy")
            yield path, "crazyflie", mocap if mocap.is_file() else None


def _judge(
    report: Report, name: str, vehicle: str, recording: Recording, seeds: Iterable[int]
) -> None:
    if len(recording.truth) < 2:
        report.notes.append(f"{name}: it has no truth, so nothing is judged")
        return
    truth = Truth(recording.truth_ns, recording.truth)
    stamps = recording.imu["stamp_ns"]
    window = Window(int(stamps[0]) + SETTLE_NS, int(stamps[-1]), "")
    if len(recording.state):
        row = recorded_row(recording, truth, window)
        figures = _figures(row.values) | _aligned(
            recording, truth, window, recording.state_ns, recording.state
        )
        report.rows.append(Row(f"{name}: the vehicle's own filter", figures))
    store = MeasurementStore(recording, truth)
    if recording.sweeps:
        [one] = plan_runs(recording, (), ["error_state"], (), "sweeps")
        for word in ("error_state on sweeps", "… base stations surveyed"):
            done = replay(recording, one, store.of(one))
            figures = _figures(run_row(recording, truth, window, one, done).values)
            began = stamps > (done.started_ns or stamps[-1])
            figures |= _aligned(recording, truth, window, stamps[began], done.states[began])
            report.rows.append(Row(f"{name}: {word}", figures))
            if word.startswith("error"):
                survey_stations(recording, one)
        _hold(report, name, vehicle, "sweeps", figures)
    if not np.isfinite(truth.quaternion_wb).all():
        report.notes.append(f"{name}: its truth has no attitude: no measurements are made of it")
        return
    layout = f"'bearings.layout={_beacons(recording)}'"
    asked = [
        (kind, estimator, f"{estimator} {' '.join(words)} {noise}.seed=")
        for kind, noise, words in (
            ("poses", "tracker", POSES),
            ("bearings", "bearings", (*BEARINGS, layout)),
        )
        for estimator in registry.names()
    ]
    for kind, estimator, words in asked:
        found = []
        for seed in seeds:
            [one] = plan_runs(recording, (), [f"{words}{seed}"], (), None)
            row = run_row(recording, truth, window, one, replay(recording, one, store.of(one)))
            found.append(_figures(row.values))
            if row.note:
                report.notes.append(f"{name}, {estimator} on {kind}, seed {seed}: {row.note}")
        figures = _together(found)
        report.rows.append(Row(f"{name}: {estimator} on {kind}", figures))
        if estimator != "error_state":
            continue
        _hold(report, name, vehicle, kind, figures)


def _hold(
    report: Report, name: str, vehicle: str, kind: str, figures: dict[str, float | str]
) -> None:
    for figure, limit in LIMITS.get((vehicle, kind), {}).items():
        reached = figures[figure]
        found = float("inf") if isinstance(reached, str) else reached
        report.targets.append(Target(f"{name}, {kind}: {figure}", found, limit))


def _figures(values: dict[str, Value]) -> dict[str, float | str]:
    wanted = (
        ("position mm", "position_rms_m", 1e3),
        ("largest", "position_max_m", 1e3),
        ("velocity mm/s", "velocity_rms_m_s", 1e3),
        ("attitude deg", "attitude_rms_deg", 1.0),
        ("refused %", "rejected_share", 1e2),
        ("NIS", "nis", 1.0),
    )
    found = {name: (values[key], unit) for name, key, unit in wanted}
    return {
        name: "-" if value is None else unit * float(value) for name, (value, unit) in found.items()
    }


def _aligned(
    recording: Recording, truth: Truth, window: Window, stamps_ns: Stamps, states: Record
) -> dict[str, float | str]:
    """Return mean and worst distance, mm, where a base station was in view lately, after the
    positions were turned and moved onto the truth and their clock shifted for the smallest mean:
    the figures of Taffanel et al. 2021. The truth's clock was found by the vehicle's own estimate,
    which may be late.
    """
    seen = np.array([one.measurement["stamp_ns"][0] for one in recording.sweeps], np.int64)
    found = []
    for shift_ns in SHIFTS_NS:
        at = stamps_ns + shift_ns
        inside = truth.covers(at) & (at >= window.start_ns) & (at <= window.end_ns)
        inside &= np.isfinite(states["position_w"]).all(axis=1)
        for k in np.flatnonzero(np.diff(seen) > HIDDEN_NS):
            inside &= (at < seen[k]) | (at > seen[k + 1] + AGAIN_NS)
        if inside.sum() < 2:
            return {}
        own, true = states["position_w"][inside], truth.at(at[inside])[0]
        matrix = best_turn(own, true).matrix
        away = (own - own.mean(axis=0)) @ matrix.T + true.mean(axis=0) - true
        length = 1e3 * np.linalg.norm(away, axis=1)
        found.append((float(length.mean()), float(length.max())))
    mean, worst = min(found)
    return {"aligned mean mm": mean, "aligned worst mm": worst}


def _together(found: list[dict[str, float | str]]) -> dict[str, float | str]:
    """Return the figures of all seeds: the largest, the mean, or the root mean square."""
    together: dict[str, float | str] = {}
    for name in found[0]:
        values = np.array([np.nan if isinstance(one[name], str) else one[name] for one in found])
        if np.isnan(values).any():
            together[name] = "-"
        elif name == "largest":
            together[name] = float(values.max())
        elif name in ("refused %", "NIS"):
            together[name] = float(values.mean())
        else:
            together[name] = float(np.sqrt(np.mean(values**2)))
    return together


def _beacons(recording: Recording) -> str:
    """Return a layout of 4 beacons at the corners of the flown area, 0.1 m below its floor."""
    place = recording.truth["position_w"]
    low, high = np.percentile(place, 1.0, axis=0), np.percentile(place, 99.0, axis=0)
    wider = np.maximum(0.0, 1.0 - 0.5 * (high - low)) * [1.0, 1.0, 0.0]  # 2 m at least
    low, high = low - wider, high + wider
    corners = ((high[0], high[1]), (low[0], high[1]), (low[0], low[1]), (high[0], low[1]))
    return "; ".join(
        f"{k} {x:.2f} {y:.2f} {low[2] - 0.1:.2f}" for k, (x, y) in enumerate(corners, start=1)
    )
