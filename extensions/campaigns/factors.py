"""The values that a parameter takes in a campaign: a list, a range or a distribution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag
from pydantic import model_validator as validator

from quadrotor.similar_names import did_you_mean

Value = bool | int | float | str
MOST_FLIGHTS = 10_000_000


class Part(BaseModel):
    model_config = ConfigDict(
        extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Range(Part):
    """Values from one number to another; sampled designs draw them evenly in between."""

    low: float = Field(alias="from")
    """first value"""
    high: float = Field(alias="to")
    """last value"""
    number: int | None = Field(default=None, ge=2, le=MOST_FLIGHTS)
    """how many values, for a grid, zip or one_at_a_time"""
    log: bool = False
    """whether the values have equal ratios, not equal differences"""

    @validator(mode="after")
    def _in_order(self) -> Range:
        if not self.low < self.high:
            raise ValueError(f"from = {self.low:g} is not below to = {self.high:g}")
        if self.log and self.low <= 0.0:
            raise ValueError(f"from = {self.low:g} has no logarithm: it must be above 0")
        return self


class Distribution(Part):
    """A distribution of scipy.stats, such as norm, with its parameters (loc, scale, a, b, …)."""

    model_config = ConfigDict(extra="allow")
    distribution: str
    """name in scipy.stats"""
    number: int | None = Field(default=None, ge=1, le=MOST_FLIGHTS)
    """how many quantiles, for a grid, zip or one_at_a_time"""

    @validator(mode="after")
    def _exists(self) -> Distribution:
        self.frozen()
        return self

    def frozen(self) -> Any:
        """Return the frozen distribution. Raises ValueError for a wrong name or parameter."""
        from scipy import stats

        names = [n for n in dir(stats) if isinstance(getattr(stats, n), stats.rv_continuous)]
        if self.distribution not in names:
            raise ValueError(
                f"scipy.stats has no distribution {self.distribution!r}"
                f"{did_you_mean(self.distribution, names, before='; ')}"
            )
        try:
            frozen = getattr(stats, self.distribution)(**(self.model_extra or {}))
        except TypeError as error:
            raise ValueError(f"{self.distribution}: {error}") from None
        if not math.isfinite(frozen.ppf(0.5)):
            raise ValueError(f"{self.distribution} has no median with {self.model_extra}")
        return frozen


class Correlation(Part):
    """Two factors of a sampled design that are not independent."""

    factors: tuple[str, str] = Field(strict=False)
    """their names"""
    rho: float = Field(gt=-1.0, lt=1.0)
    """correlation of the normal scores of both (a Gaussian copula): each keeps its distribution"""


def correlation_matrix(
    correlations: Sequence[Correlation], names: Sequence[str]
) -> npt.NDArray[np.float64]:
    """Return the correlations of factors, in the order of their names.

    Raises ValueError for an unknown factor, or a matrix that no factors have.
    """
    found = np.eye(len(names))
    for one in correlations:
        for name in one.factors:
            if name not in names:
                hint = did_you_mean(name, names, before="; ")
                raise ValueError(f"correlations: {name} is no factor{hint}")
        a, b = (names.index(name) for name in one.factors)
        found[a, b] = found[b, a] = one.rho
    if np.linalg.eigvalsh(found).min() <= 1e-9:
        raise ValueError(
            "correlations: no factors have all of these at once (their matrix is not positive "
            "definite); lower some"
        )
    return found


def kind_of(found: object) -> str:
    """Return which kind of factor this is, for pydantic."""
    if isinstance(found, list):
        return "list"
    has = found if isinstance(found, dict) else getattr(found, "__dict__", {})
    return "distribution" if "distribution" in has else "range"


Factor = Annotated[
    Annotated[list[Value], Tag("list"), Field(min_length=1)]
    | Annotated[Range, Tag("range")]
    | Annotated[Distribution, Tag("distribution")],
    Discriminator(kind_of),
]
