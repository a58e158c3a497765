"""The cells of a plan: the value of each factor in each of them, and the seed of each flight."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bearing_sim.sampling import ALL, STEP, splitmix64
from extensions.campaigns.factors import (
    MOST_FLIGHTS,
    Distribution,
    Factor,
    Range,
    Value,
    correlation_matrix,
)
from extensions.campaigns.plan import SALTELLI, SAMPLED, Plan
from quadlab.simulated.experiment import LARGEST_SEED
from quadrotor.errors import UsageError

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Cells:
    """The cells of a plan, each with `plan.seeds` flights: flight k is of cell k // seeds.

    A search has the cells of its factors once for each trial.

    Args:
        trials: values of the searched parameters in the trials so far.

    Raises UsageError for more flights than a campaign may have.
    """

    plan: Plan
    trials: dict[int, dict[str, Value]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise UsageError for a number of cells that cannot be flown."""
        if self.flights > MOST_FLIGHTS:
            raise UsageError(
                f"the plan has {self.flights:.3g} flights ({self.number:.3g} cells of "
                f"{self.plan.seeds} seeds), allowed are {MOST_FLIGHTS:.0e}; take fewer values, or "
                'a sampled design, such as design = "latin_hypercube" with samples = 1000'
            )
        if self.plan.design == "zip" and len({len(one) for one in self._values.values()}) > 1:
            counts = ", ".join(f"{name} {len(one)}" for name, one in self._values.items())
            raise UsageError(f'design = "zip" needs as many values of each factor; has {counts}')

    @property
    def number(self) -> int:
        """Return the number of cells."""
        return self._alone * (self.plan.search.trials if self.plan.search else 1)

    @property
    def known(self) -> int:
        """Return the number of cells whose values are known: not those of trials to come."""
        return self._alone * len(self.trials) if self.plan.search else self.number

    @property
    def _alone(self) -> int:
        """Return the number of cells of the factors."""
        plan = self.plan
        if plan.samples is not None:
            return plan.samples * (len(plan.factors) + 2 if plan.design == SALTELLI else 1)
        counts = [_count(one) for one in plan.factors.values()]
        if plan.design == "zip":
            return max(counts, default=1)
        if plan.design == "one_at_a_time":
            return 1 + sum(count - 1 for count in counts)
        return math.prod(counts)

    @property
    def flights(self) -> int:
        return self.number * self.plan.seeds

    def seed(self, index: int) -> int:
        """Return the seed of a flight; all trials of a search have the same seeds."""
        return seed_of(self.plan, index % (self._alone * self.plan.seeds))

    def of_trial(self, number: int, seeds: int) -> list[int]:
        """Return the flights of a trial in all cells of the factors, with the first seeds."""
        cells = range(number * self._alone, (number + 1) * self._alone)
        return [cell * self.plan.seeds + k for k in range(seeds) for cell in cells]

    def trial(self, index: int) -> int:
        """Return the number of the trial to which a flight belongs."""
        return index // (self._alone * self.plan.seeds)

    def column(self, name: str, cells: Indices) -> list[Value]:
        """Return a factor's value in each of these cells."""
        if self.plan.search is not None and name in self.plan.search.parameters:
            return [self.trials[trial][name] for trial in (cells // self._alone).tolist()]
        cells = cells % self._alone
        values, place = self._values[name], list(self._values).index(name)
        if self.plan.design in SAMPLED or self.plan.design == "zip":
            return [values[cell] for cell in cells]
        counts = [len(one) for one in self._values.values()]
        if self.plan.design == "grid":
            return [values[k] for k in np.unravel_index(cells, counts)[place]]
        before = 1 + sum(count - 1 for count in counts[:place])
        steps = np.where((cells >= before) & (cells < before + len(values) - 1), cells, before - 1)
        return [values[k - before + 1] for k in steps]

    def factors(self, cell: int) -> dict[str, Value]:
        """Return the value of each factor in one cell."""
        return {name: self.column(name, np.array([cell]))[0] for name in self.plan.varied}

    @cached_property
    def _values(self) -> dict[str, list[Value]]:
        """Return the values of each factor, in a sampled design one for each cell."""
        factors = self.plan.factors
        if self.plan.design not in SAMPLED:
            return {name: _levels(one) for name, one in factors.items()}
        unit = _unit(self.plan.design, self._alone, len(factors), self.plan.seed)
        if self.plan.correlations:
            unit = _correlated(unit, correlation_matrix(self.plan.correlations, list(factors)))
        return {name: _at(one, unit[:, k]) for k, (name, one) in enumerate(factors.items())}


def seed_of(plan: Plan, index: int) -> int:
    """Return the seed of a flight: a hash of the plan's seed and the flight's index."""
    return splitmix64(splitmix64(plan.seed) + (index + 1) * STEP & ALL) % (LARGEST_SEED + 1)


def _count(factor: Factor) -> int:
    return len(factor) if isinstance(factor, list) else factor.number or 1


def _levels(factor: Factor) -> list[Value]:
    if isinstance(factor, list):
        return _even(factor)
    count = factor.number or 1
    if isinstance(factor, Distribution):
        return _at(factor, (np.arange(count) + 0.5) / count)
    return _at(factor, np.linspace(0.0, 1.0, count))


def _even(values: list[Value]) -> list[Value]:
    """Return the values of a list, all as floats if some are."""
    kinds = {type(one) for one in values}
    return [float(one) for one in values] if kinds == {int, float} else values


def _at(factor: Factor, unit: npt.NDArray[np.float64]) -> list[Value]:
    """Return the values at these shares (0..1) of a factor's distribution."""
    if isinstance(factor, list):
        values = _even(factor)
        return [values[min(int(u * len(values)), len(values) - 1)] for u in unit]
    if isinstance(factor, Distribution):
        found: list[Value] = factor.frozen().ppf(unit).tolist()
        return found
    assert isinstance(factor, Range)
    low, high = factor.low, factor.high
    if factor.log:
        low, high = math.log(low), math.log(high)
    spread = low + (high - low) * unit
    even = np.exp(spread) if factor.log else spread
    clipped: list[Value] = np.clip(even, factor.low, factor.high).tolist()
    return clipped


def _correlated(
    unit: npt.NDArray[np.float64], matrix: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return points whose normal scores have these correlations, of independent points."""
    from scipy.stats import norm

    found: npt.NDArray[np.float64] = norm.cdf(norm.ppf(unit) @ np.linalg.cholesky(matrix).T)
    return found


def _unit(design: str, number: int, factors: int, seed: int) -> npt.NDArray[np.float64]:
    """Return points of the unit cube, (number, factors)."""
    if design == SALTELLI:
        from SALib.sample import sobol

        problem = {"num_vars": factors, "names": [str(k) for k in range(factors)]}
        problem["bounds"] = [[0.0, 1.0]] * factors
        base = number // (factors + 2)
        found: npt.NDArray[np.float64] = sobol.sample(
            problem, base, calc_second_order=False, seed=seed
        )
        return found
    random = np.random.default_rng(seed)
    if design == "random":
        return random.random((number, factors))
    from scipy.stats import qmc

    kind = qmc.LatinHypercube if design == "latin_hypercube" else qmc.Sobol
    points: npt.NDArray[np.float64] = kind(factors, seed=random).random(number)
    return points
