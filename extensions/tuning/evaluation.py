"""Evaluates a step test: from the columns of the log to its figures and plots."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from control.trajectories.multistep import AXES, LEVELS, POSITION
from extensions.tuning.collection import Gap, Samples
from extensions.tuning.step_response import FIGURES, step_response
from quadrotor.errors import StorageError
from quadrotor.plain_rotations import roll_pitch_yaw_of_rows
from quadrotor.records import Array

_STATE, _REFERENCE = "state.pose.pose", "reference"
COLUMNS = (
    *(f"{_STATE}.position.{i}" for i in range(3)),
    *(f"{_STATE}.orientation.{i}" for i in range(4)),
    *(f"{_REFERENCE}.position.{i}" for i in range(3)),
    f"{_REFERENCE}.yaw",
    *(f"actuators.motor_references.{i}" for i in range(4)),
    "actuators.torque.2",
    "actuators.scaling",
)
"""Signals from which a test is judged."""

EDGE_MIN = 0.005
"""Smallest edge, m or rad between two ticks; excite steps by at least 0.01."""
BEFORE = 0.05
"""Seconds before an edge over which its initial value is averaged."""
SHOWN_BEFORE, SHOWN_AFTER = 0.4, 0.3
"""Seconds shown before the first edge, and after the last level."""


@dataclass(frozen=True)
class Plan:
    """The plan of a test: the arguments of `excite`."""

    axis: str
    shape: str
    amplitude: float
    duration: float
    repeats: int

    @property
    def edges(self) -> int:
        return len(LEVELS[self.shape]) * self.repeats


@dataclass(frozen=True)
class Evaluation:
    """The result of a step test.

    Attributes:
        figures: means over the edges, and of the whole test; None when not reached.
        edges: time (s since the first), swing (m or rad) and figures of each.
        time: s since the first edge, shape (N,).
        setpoint, actual: relative to the set-point before the first edge, shape (N,).
        gaps: s since the first edge.
        problems: why it is incomplete, as text; empty when it is complete.
    """

    figures: dict[str, float | None]
    edges: list[dict[str, float | None]]
    time: Array
    setpoint: Array
    actual: Array
    gaps: list[tuple[float, float]]
    problems: list[str]


def evaluate(samples: Samples, plan: Plan) -> Evaluation:
    """Evaluate a step test. Raises StorageError when it has no edge."""
    time, actual, setpoint = samples.time, _actual(samples), _setpoint(samples)
    along = AXES.index(plan.axis)
    at = _edges_of(setpoint[along], plan)
    if not len(at):
        raise StorageError("the set-point does not step in what the vehicle's log has")
    starts = time[at]
    ends = np.append(starts[1:], starts[-1] + plan.duration)
    edges = [
        _edge(
            time,
            actual[along],
            setpoint=setpoint[along],
            start=start,
            end=end,
            gaps=samples.gaps,
            first=starts[0],
        )
        for start, end in zip(starts, ends, strict=True)
    ]
    gaps = [
        gap
        for gap in samples.gaps
        if gap.start < ends[-1] + SHOWN_AFTER and gap.end > starts[0] - SHOWN_BEFORE
    ]
    shown = (time >= starts[0] - SHOWN_BEFORE) & (time <= ends[-1] + SHOWN_AFTER)
    flown = (time >= starts[0]) & (time <= ends[-1])
    zero = float(setpoint[along][at[0] - 1])
    problems = _problems(samples.problem, gaps, plan, edges)
    if single := samples.single:
        problems.append(f"{single} of {len(time)} ticks are missing, one by one")
    return Evaluation(
        figures=_means(edges) | _whole(samples, actual, setpoint, time, flown, along),
        edges=edges,
        time=time[shown] - starts[0],
        setpoint=setpoint[along][shown] - zero,
        actual=actual[along][shown] - zero,
        gaps=[(gap.start - float(starts[0]), gap.end - float(starts[0])) for gap in gaps],
        problems=problems,
    )


def drawn(evaluation: Evaluation) -> dict[str, list[Any]]:
    """Return time, setpoint, actual for a chart; None between the two ends of a gap."""
    columns = {
        "time": evaluation.time.round(4).tolist(),
        "setpoint": evaluation.setpoint.round(5).tolist(),
        "actual": evaluation.actual.round(5).tolist(),
    }
    for start, end in reversed(evaluation.gaps):
        at = int(np.searchsorted(evaluation.time, end - 1e-9))
        if 0 < at < len(evaluation.time):
            for name, values in columns.items():
                values.insert(at, round(0.5 * (start + end), 4) if name == "time" else None)
    return columns


def _edges_of(setpoint: Array, plan: Plan) -> npt.NDArray[np.int_]:
    """Return the samples at which the set-point reaches the plan's levels, one after the other.

    Other jumps do not belong to the plan: the vehicle ended the test, or a person took over.
    """
    jumps = np.flatnonzero(np.abs(np.diff(setpoint)) > EDGE_MIN) + 1
    levels = [level * plan.amplitude for level in LEVELS[plan.shape]] * plan.repeats
    found: list[int] = []
    for at, level in zip(jumps, levels, strict=False):
        if abs(setpoint[at] - setpoint[jumps[0] - 1] - level) > 0.5 * EDGE_MIN:
            break
        found.append(int(at))
    return np.array(found, int)


def _edge(
    time: Array,
    actual: Array,
    setpoint: Array,
    start: float,
    end: float,
    gaps: tuple[Gap, ...],
    first: float,
) -> dict[str, float | None]:
    """Return the figures of one edge; all None when some of its ticks are missing."""
    inside = (time >= start) & (time < end - 1e-9)
    before = (time >= start - BEFORE) & (time < start)
    level = float(np.median(setpoint[inside]))
    swing = level - float(setpoint[before][-1]) if before.any() else 0.0
    out: dict[str, float | None] = {"time": start - first, "swing": swing}
    torn = any(gap.start < end and gap.end > start - BEFORE for gap in gaps)
    torn = torn or bool((np.abs(setpoint[inside] - level) > EDGE_MIN).any())
    if torn or not before.any() or time[-1] < end - 2 * BEFORE:
        return out | dict.fromkeys(FIGURES)
    began = float(actual[before].mean())
    if abs(level - began) < EDGE_MIN:
        return out | dict.fromkeys(FIGURES)
    return out | asdict(step_response(time[inside] - start, actual[inside], began, level))


def _means(edges: list[dict[str, float | None]]) -> dict[str, float | None]:
    """Return the means over the complete edges; None when one of these does not reach a figure."""
    whole = [edge for edge in edges if edge["rms_error"] is not None]
    means: dict[str, float | None] = {}
    for name in FIGURES:
        # errors of edges up and down must not cancel
        values = [abs(value) for edge in whole if (value := edge[name]) is not None]
        complete = bool(whole) and len(values) == len(whole)
        means[name] = float(np.mean(values)) if complete else None
    return means


def _whole(
    samples: Samples,
    actual: Array,
    setpoint: Array,
    time: Array,
    flown: npt.NDArray[np.bool_],
    along: int,
) -> dict[str, float | None]:
    """Return the figures of the whole test: of the motors, and of the other axes."""
    motors = np.stack([samples.values[f"actuators.motor_references.{i}"] for i in range(4)])
    scaling = samples.values["actuators.scaling"][flown]
    error = setpoint - actual
    before = (time >= time[flown][0] - SHOWN_BEFORE) & (time < time[flown][0])
    out: dict[str, float | None] = {
        "peak_motor": float(motors[:, flown].max()),
        "saturated": 100.0 * float(np.mean(scaling < 1.0 - 1e-6)),
        "peak_tilt": float(np.degrees(_tilt(samples)[flown].max())),
        "peak_yaw_torque": float(np.abs(samples.values["actuators.torque.2"][flown]).max()),
    }
    for i, axis in enumerate(AXES):
        if i != along:
            rest = float(error[i][before].mean()) if before.any() else 0.0
            out[f"cross_{axis}"] = float(np.abs(error[i][flown] - rest).max())
    return out


def _problems(
    problem: str, gaps: list[Gap], plan: Plan, edges: list[dict[str, float | None]]
) -> list[str]:
    problems = [problem] if problem else []
    if gaps:
        lost = sum(gap.end - gap.start for gap in gaps)
        problems.append(
            f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''} in the vehicle's log, "
            f"{1e3 * lost:.0f} ms: drawn as gaps, edges with one are not judged"
        )
    if len(edges) < plan.edges:
        problems.append(f"it ended early: {len(edges)} of {plan.edges} edges were flown")
    elif edges[-1]["rms_error"] is None and not gaps:
        problems.append("it ended before its last level was over")
    return problems


def _actual(samples: Samples) -> Array:
    """Return x, y, z (m) and yaw (rad, without jumps), shape (4, N)."""
    v = samples.values
    q = np.stack([v[f"{_STATE}.orientation.{i}"].astype(float) for i in (3, 0, 1, 2)], axis=1)
    yaw = roll_pitch_yaw_of_rows(q)[:, 2]
    positions = [v[f"{_STATE}.position.{i}"].astype(float) for i in range(len(POSITION))]
    return np.stack([*positions, np.unwrap(yaw)])


def _setpoint(samples: Samples) -> Array:
    """Return the set-point like `_actual`; yaw on the turn that is nearest to the actual one."""
    v = samples.values
    positions = [v[f"{_REFERENCE}.position.{i}"].astype(float) for i in range(len(POSITION))]
    yaw = v[f"{_REFERENCE}.yaw"].astype(float)
    turns = np.round((_actual(samples)[3, 0] - yaw[0]) / (2.0 * np.pi))
    return np.stack([*positions, yaw + 2.0 * np.pi * turns])


def _tilt(samples: Samples) -> Array:
    """Return the angle (rad) between the body's up and the world's."""
    x, y = (samples.values[f"{_STATE}.orientation.{i}"].astype(float) for i in range(2))
    tilt: Array = np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0))
    return tilt
