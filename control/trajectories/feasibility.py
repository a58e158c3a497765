"""The feasibility of a trajectory: its largest demands, and when they exceed a limit.

Every stretch of the trajectory is sampled, the inverse dynamics (`flatness`) are computed for each
sample, and the neighbourhood of each extreme and of each first breach is sampled again, finer. A
figure of eight takes 0.3 ms, so it can be checked between two ticks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from control.keep_out import AROUND, KeepOut, first_encounter
from control.trajectories.flatness import wrench_of_reference
from control.trajectories.limits import QUANTITIES, WALLS, Limits
from control.trajectories.trajectory import Trajectory, grid_sampler, stretches_of
from quadrotor.compiled import compiled
from quadrotor.records import REFERENCE, Record
from quadrotor.vectors import length, vector
from quadrotor.vehicle_model import thrusts_of_wrench

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

FINER = 17
"""Number of samples of the second, finer pass at an extreme or a breach."""

TIME_RESOLUTION = 1e-3
"""Resolution, in s, of the time of the first breach."""


@dataclass(frozen=True, slots=True)
class Extreme:
    """The worst value of one quantity, and the first time its limit is exceeded, None if never."""

    index: int  # into limits.QUANTITIES
    value: float  # as displayed: degrees for the tilt, else SI
    limit: float
    time: float  # s, of the worst value
    first: float | None  # s

    @property
    def name(self) -> str:
        return QUANTITIES[self.index].name

    @property
    def unit(self) -> str:
        return QUANTITIES[self.index].unit


@dataclass(frozen=True, slots=True)
class Feasibility:
    """The extremes of a trajectory, in the order of limits.QUANTITIES."""

    extremes: tuple[Extreme, ...]
    limits: Limits

    @property
    def feasible(self) -> bool:
        return all(e.first is None for e in self.extremes)

    @property
    def breach(self) -> Extreme | None:
        """Return the first breach in the order of QUANTITIES: causes precede their effects."""
        return next((e for e in self.extremes if e.first is not None), None)

    def of(self, name: str) -> Extreme:
        """Return the extreme of this name; for a coordinate, the largest. Raises KeyError."""
        for extreme in reversed(self.extremes):
            if extreme.name == name:
                return extreme
        raise KeyError(name)


@compiled
def survey(
    references: Record,
    model: Record,
    limits: Array,
    values: Array,
    worst: Array,
    worst_at: Indices,
    first: Indices,
    stop: bool,
) -> None:
    """Find the largest of each demand, its sample, and the first sample above its limit, else -1.

    Demands, in the order of limits.QUANTITIES: -x, x, -y, y, -z, z, speed, acceleration, |yaw
    rate|, |yaw acceleration|, tilt, -(least motor thrust), largest motor thrust, |body rate|, |yaw
    torque|. A value that is not a number counts as inf.

    Args:
        references: REFERENCE, shape (N,), N at least 1.
        model: MODEL, shape (1,).
        limits, values, worst: (15,); the first is read, the second is scratch, the third is
            written.
        worst_at, first: (15,), written.
        stop: whether to end at the first sample that exceeds a limit.
    """
    m = model[0]
    for q in range(values.shape[0]):
        worst[q] = -math.inf
        worst_at[q] = 0
        first[q] = -1
    broken = False
    for k in range(references.shape[0]):
        r = references[k]
        axes, omega_b, _, wrench = wrench_of_reference(r, m)
        for i in range(3):
            values[2 * i] = -r.position_w[i]
            values[2 * i + 1] = r.position_w[i]
        values[6] = length(vector(r.velocity_w))
        values[7] = length(vector(r.acceleration_w))
        values[8] = abs(r.yaw_rate)
        values[9] = abs(r.yaw_acceleration)
        z = axes[2]
        values[10] = math.atan2(math.sqrt(z[0] * z[0] + z[1] * z[1]), z[2])
        values[11] = -math.inf
        values[12] = -math.inf
        for thrust in thrusts_of_wrench(wrench, m.arm, m.torque_ratio):
            values[11] = max(values[11], -thrust)
            values[12] = max(values[12], thrust)
        values[13] = length(omega_b)
        values[14] = abs(wrench[3])
        for q in range(values.shape[0]):
            value = values[q] if values[q] == values[q] else math.inf
            if value > worst[q]:
                worst[q] = value
                worst_at[q] = k
            if value > limits[q] and first[q] < 0:
                first[q] = k
                broken = True
        if broken and stop:
            return


class Survey:
    """Surveys of references, with their buffers.

    Attributes:
        limits, worst, worst_at, first: (15,), of the last survey; see `survey`.
    """

    def __init__(self, model: Record, limits: Limits) -> None:
        self._model, self.limits, count = model, limits.as_array(), len(QUANTITIES)
        self._values, self.worst = np.empty(count), np.empty(count)
        self.worst_at, self.first = np.empty(count, np.int64), np.empty(count, np.int64)

    def run(self, references: Record, stop: bool = False) -> None:
        """Survey REFERENCE records (N,)."""
        found = self._values, self.worst, self.worst_at, self.first
        survey(references, self._model, self.limits, *found, stop)


def grid_of(trajectory: Trajectory) -> tuple[Record, Array]:
    """Return references and times (s) of all stretches of a trajectory."""
    stretches, sample = stretches_of(trajectory), grid_sampler(trajectory)
    references = np.empty(sum(count for _, _, count in stretches), REFERENCE)
    times = np.empty(len(references))
    at = 0
    for begin, end, count in stretches:
        times[at : at + count] = np.linspace(begin, end, count)
        sample(begin, (end - begin) / (count - 1), references[at : at + count])
        at += count
    return references, times


class _TrajectorySurvey(Survey):
    """Surveys of parts of one trajectory."""

    def __init__(self, trajectory: Trajectory, model: Record, limits: Limits) -> None:
        super().__init__(model, limits)
        self.sample = grid_sampler(trajectory)
        self.fine = np.empty(FINER, REFERENCE)

    def between(self, low: float, high: float) -> float:
        """Survey FINER samples of low..high; return their step (s)."""
        step = (high - low) / (FINER - 1)
        self.sample(low, step, self.fine)
        self.run(self.fine)
        return step

    def breach(self, q: int, low: float, high: float) -> float:
        """Return the time in low..high from which quantity q exceeds its limit, as at `high`."""
        while high - low > TIME_RESOLUTION:
            step = self.between(low, high)
            k = int(self.first[q])
            if k <= 0:
                return low if k == 0 else high
            low, high = low + (k - 1) * step, low + k * step
        return high


def examine(trajectory: Trajectory, model: Record, limits: Limits) -> Feasibility:
    """Return the extremes of a finite trajectory, flown by the vehicle of `model` (MODEL, (1,))."""
    parts = _TrajectorySurvey(trajectory, model, limits)
    references, times = grid_of(trajectory)
    parts.run(references)
    worst, worst_at, first = parts.worst.copy(), parts.worst_at.copy(), parts.first.copy()
    at = times[worst_at]
    broken: dict[int, tuple[float, float]] = {
        q: (float(times[max(k - 1, 0)]), float(times[k]))
        for q, k in enumerate(first.tolist())
        if k >= 0
    }
    last = len(times) - 1
    for k in sorted(set(worst_at.tolist())):
        low, high = float(times[max(k - 1, 0)]), float(times[min(k + 1, last)])
        # The gap between two stretches repeats what is sampled elsewhere.
        step = parts.between(low, high)
        for q in np.flatnonzero(worst_at == k).tolist():
            if parts.worst[q] > worst[q]:
                worst[q] = parts.worst[q]
                at[q] = low + step * int(parts.worst_at[q])
            f = int(parts.first[q])
            if f >= 0 and q not in broken:
                broken[q] = (low + step * max(f - 1, 0), low + step * f)
    found = {q: parts.breach(q, low, high) for q, (low, high) in broken.items()}
    bounds = limits.as_array()
    extremes = []
    for q, quantity in enumerate(QUANTITIES):
        shown = quantity.sign * quantity.scale
        limit = float(bounds[q]) - (1e-6 if q < WALLS else 0.0)
        extremes.append(
            Extreme(q, shown * float(worst[q]), shown * limit, float(at[q]), found.get(q))
        )
    return Feasibility(tuple(extremes), limits)


def encounter(trajectory: Trajectory, boxes: KeepOut, margin: float) -> str:
    """Return where and when a path comes nearer than `margin` (m) to a keep-out box; "" if never.

    The samples of a survey are joined by straight lines.
    """
    if not boxes:
        return ""
    references, times = grid_of(trajectory)
    found = first_encounter(boxes, references["position_w"], margin)
    if found is None:
        return ""
    after = np.interp(found.at, np.arange(len(times)), times)
    return f"{found} after {after:.2f} s; {AROUND}"


def fits(trajectory: Trajectory, model: Record, limits: Limits) -> bool:
    """Return whether all samples keep to the limits; faster than `examine`, for searches."""
    parts = _TrajectorySurvey(trajectory, model, limits)
    parts.run(grid_of(trajectory)[0], stop=True)
    return bool((parts.first < 0).all())


def refusal(report: Feasibility, breach: Extreme, what: str, advice: str = "") -> str:
    """Return one line: what is demanded, from when, what is allowed and by which parameter."""
    q, since = breach.index, f"from {breach.first:.2f} s on"
    quantity = QUANTITIES[q]
    if q < WALLS:
        other = report.extremes[q + 1 if quantity.sign < 0.0 else q - 1]
        low, high = sorted((breach.limit, other.limit))
        beyond = abs(breach.value - breach.limit)
        towards = "+" if quantity.sign < 0.0 else "-"
        return (
            f"{what} refused: the path's {breach.name} = {breach.value:.2f} m is outside the "
            f"flight volume {since}; allowed {low:g} to {high:g} m ({quantity.source}); "
            f"make it smaller or start {beyond:.2f} m further towards {towards}{breach.name}"
        )
    least = quantity.sign < 0.0
    allowed = "at least" if least else "up to"
    unit = breach.unit
    return (
        f"{what} refused: its {breach.name} reaches {breach.value:.3g} {unit} (beyond the limit "
        f"{since}); allowed {allowed} {breach.limit:.3g} {unit} ({quantity.source})"
        f"{'; ' + advice if advice else ''}"
    )
