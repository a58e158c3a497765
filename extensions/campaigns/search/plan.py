"""The part `[search]` of a plan."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag
from pydantic import model_validator as validator

from extensions.campaigns.factors import Part, Range, Value, kind_of

Sampler = Literal["tpe", "cma_es", "nsga2", "random"]
Searched = Annotated[
    Annotated[list[Value], Tag("list"), Field(min_length=2)] | Annotated[Range, Tag("range")],
    Discriminator(kind_of),
]


class Search(Part):
    """A search: trials of parameters, each flown in all cells of the factors, with all seeds."""

    trials: int = Field(ge=1, le=100_000)
    """how many"""
    parameters: dict[str, Searched] = Field(min_length=1)
    """lists or ranges, by the parameter's name"""
    aims: list[str] = Field(min_length=1)
    """metrics that are made small; several give a Pareto front"""
    sampler: Sampler = "tpe"
    """of Optuna: tpe, cma_es, nsga2 (for several aims) or random"""
    aggregate: Literal["worst", "median", "mean"] = "worst"
    """what an aim is of a trial's flights"""
    not_passed: int = Field(default=0, ge=0)
    """flights of a feasible trial that may not pass"""
    constraints: dict[str, float] = Field(default_factory=dict)
    """metrics with the largest value in a flight of a feasible trial"""
    delay_margin: float | None = Field(default=None, gt=0.0, le=1.0)
    """s of delay that each loop of a feasible trial bears at least, as `quadlab gains` has it"""
    phase_margin: float | None = Field(default=None, gt=0.0, le=90.0)
    """degrees of phase margin that each loop of a feasible trial has at least, as `quadlab gains`
    has it"""
    prune: bool = True
    """whether a trial that is worse than the median of the others after as many seeds is ended"""
    together: int = Field(default=4, ge=1, le=1000)
    """trials that are proposed, and flown, at once"""

    @validator(mode="after")
    def _fits(self) -> Search:
        if self.sampler == "cma_es" and any(
            isinstance(one, list) for one in self.parameters.values()
        ):
            raise ValueError('sampler = "cma_es" needs ranges, not lists: take "tpe"')
        if self.sampler == "cma_es" and len(self.aims) > 1:
            raise ValueError('sampler = "cma_es" has one aim: take "nsga2" for several')
        return self

    @property
    def margins(self) -> dict[str, float]:
        """Return the margins of the loops that a feasible trial has, by the name of their field."""
        found = {"delay_margin": self.delay_margin, "phase_margin": self.phase_margin}
        return {name: value for name, value in found.items() if value is not None}

    @property
    def metrics(self) -> list[str]:
        """Return the metrics that decide."""
        return [*self.aims, *self.constraints]
