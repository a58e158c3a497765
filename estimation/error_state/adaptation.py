"""Adaptation of the noise: factors on the variances of the parameters, learnt from innovations.

Innovations of a filter with the right noise are white and as large as it expects. Two deviations
from this are evaluated, separately for poses' positions, poses' attitudes and bearings:

- Successive innovations in the same direction show that the prediction drifts away from the
  measurements: the noise of the IMU is larger than stated (vibration, a lagging gyroscope). Those
  of a position raise the accelerometer's noise, those of an attitude the gyroscope's.
- Innovations that are too large but not in the same direction show that the measurement is noisier.

Each step is bounded whatever the innovation, so that outliers, if they are less than half of the
measurements, raise little. Refused measurements count like used ones, so that an overconfident
filter is corrected. A factor changes only once its evidence has summed to more than chance does; it
is at least 1 and at most LARGEST, and decreases again when the cause has disappeared. Noise that is
as stated is therefore left exactly as stated.
"""

from __future__ import annotations

import math

from estimation.error_state.memory import ATTITUDE, BEARING, FORCE, POSITION, RATE
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Vector, add, dot, scale, vector

CHANCE = 1.0
"""Evidence, in logarithms of a variance, that chance reaches less than once in hours."""
LARGEST = 900.0
"""Largest factor on a variance: noise 30 times as stated."""
LARGEST_BY_BEARINGS = 4.0
"""Largest factor on the IMU's variance from bearings alone. A misplaced beacon also draws the
prediction away all the time, and the IMU must not lose its weight then."""
PROCESS_PACE, MEASUREMENT_PACE = 0.06, 0.03
"""Largest change of the logarithm of a factor by one measurement."""
HURRY = 3
"""Number of refused measurements in a row, and factor by which the noise of poses then grows
faster."""
WHITE = 0.15
"""Correlation of successive innovations up to which they count as white."""
USUAL_PAIR, USUAL_TRIPLE = 1.02, 1.87
"""Sums of squares of two, and three, numbers of unit variance that 3 of 5 exceed."""
FARTHEST = 3.0
"""Deviations at which an innovation is clipped before it is compared with the last."""
FRESH_NS = 200_000_000
"""Time in ns beyond which innovations are not compared."""


@compiled(inner=True)
def gather(m: Item, kind: int, step: float) -> None:
    """Add a step to the evidence of one factor, and update the factor."""
    most = CHANCE + math.log(LARGEST)
    m.evidence[kind] = min(max(m.evidence[kind] + step, 0.0), most)
    m.noise_scale[kind] = math.exp(max(0.0, m.evidence[kind] - CHANCE))


@compiled(inner=True)
def learn(m: Item, first: int, u: Vector, largest: float) -> bool:
    """Adapt a noise of the IMU to three innovations, in deviations, up to a factor `largest`.

    They are of the position (`first` 0) or the attitude (3). Returns whether they point in the same
    direction as the last ones.
    """
    fresh = m.base_ns - m.last_ns < FRESH_NS
    squares, last_squares, product = 0.0, 0.0, 0.0
    for i in range(3):
        bounded, last = min(max(u[i], -FARTHEST), FARTHEST), m.last_unit[first + i]
        squares += bounded * bounded
        last_squares += last * last
        product += bounded * last
        m.last_unit[first + i] = bounded
    if not fresh:
        return False
    step = min(max(product / 3.0, -1.0), 1.0) - WHITE
    kind = FORCE if first == 0 else RATE
    if step < 0.0 or m.noise_scale[kind] < largest:
        gather(m, kind, PROCESS_PACE * step)
    return product > 0.5 * math.sqrt(squares * last_squares)


@compiled(inner=True)
def learn_from_pose(m: Item, whole: bool, of_process: bool) -> None:
    """Adapt to the innovation of a pose, or of a position, whose rows are linearised at the
    prediction; prior and variances are those with which it is expected.

    Args:
        whole: whether it has an attitude.
        of_process: whether it also shows something about the noise of the IMU.
    """
    pace = MEASUREMENT_PACE * (HURRY if m.refused > HURRY else 1.0)
    for first in range(0, 6 if whole else 3, 3):
        u = (unit(m, first), unit(m, first + 1), unit(m, first + 2))
        aligned = learn(m, first, u, LARGEST if of_process else 0.0)
        rises = dot(u, u) > USUAL_TRIPLE and not aligned
        gather(m, POSITION if first == 0 else ATTITUDE, pace if rises else -MEASUREMENT_PACE)
    m.last_ns = m.base_ns


@compiled(inner=True)
def unit(m: Item, i: int) -> float:
    """Return the innovation of one number of a pose, in deviations."""
    deviations: float = m.rest[i] / math.sqrt(m.expected[i])
    return deviations


@compiled(inner=True)
def learn_from_bearings(m: Item, pairs: int) -> None:
    """Adapt to the bearings of one frame: the noise of the IMU by the pose error that they indicate
    together, the noise of the bearings by their squared distances from the prediction.
    """
    aligned = False
    for first in (0, 3):
        pull, weight = (0.0, 0.0, 0.0), (1e-12, 1e-12, 1e-12)
        for k in range(2 * pairs):
            deviation = math.sqrt(m.expected[k])
            u = min(max(m.rest[k] / deviation, -FARTHEST), FARTHEST)
            row = scale(1.0 / deviation, vector(m.row[k, first:]))
            pull = add(pull, scale(u, row))
            weight = add(weight, (row[0] * row[0], row[1] * row[1], row[2] * row[2]))
        along = (
            pull[0] / math.sqrt(weight[0]),
            pull[1] / math.sqrt(weight[1]),
            pull[2] / math.sqrt(weight[2]),
        )
        aligned = learn(m, first, along, LARGEST_BY_BEARINGS) or aligned
    m.last_ns = m.base_ns
    for k in range(pairs):
        rises = m.distance[k] > USUAL_PAIR and not aligned
        gather(m, BEARING, 0.5 * MEASUREMENT_PACE if rises else -MEASUREMENT_PACE)
