"""The plan of a campaign: a TOML file, checked against a model that is also its JSON schema."""

from __future__ import annotations

import hashlib
import json
import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, ValidationError
from pydantic import model_validator as validator

from extensions.campaigns.cases import Cases, with_cases
from extensions.campaigns.factors import Correlation, Factor, Part, Range, Value, correlation_matrix
from extensions.campaigns.recorded import logs as over_logs
from extensions.campaigns.search.plan import Search
from quadrotor.errors import StorageError, UsageError, os_errors
from quadrotor.similar_names import did_you_mean

COMPILED = "closed_loop"
"""The experiment that is flown in compiled code."""
OWN = "own"
"""Folder of a campaign with copies of the files that its plan names."""
Design = Literal["grid", "zip", "one_at_a_time", "random", "latin_hypercube", "sobol", "saltelli"]
SALTELLI = "saltelli"
"""The design that Sobol' indices need: samples × (number of factors + 2) cells."""
SAMPLED = ("random", "latin_hypercube", "sobol", SALTELLI)
"""Designs with a number of samples."""


class Keep(Part):
    """The files that are kept beside the rows."""

    logs: Literal["none", "failed", "all", "worst"] = "none"
    """none; failed: of flights that did not pass; all; worst: of those with the largest metric"""
    number: int = Field(default=5, ge=1, le=10_000)
    """how many, for worst"""
    metric: str = ""
    """by which the worst are chosen"""

    @validator(mode="after")
    def _has_metric(self) -> Keep:
        if self.logs == "worst" and not self.metric:
            raise ValueError('logs = "worst" needs metric = "…", by which they are chosen')
        return self


class Plan(Part):
    """The flights of a campaign: an experiment, in each cell of the factors, with several seeds."""

    experiment: str = Field(min_length=1)
    """an experiment of `quadlab fly`, a file of your own, or closed_loop, which is compiled; over
    logs: explanation or replay"""
    logs: str = ""
    """recorded flights instead of simulated ones: a pattern of logs, or of folders of runs"""
    seeds: int = Field(default=1, ge=1)
    """flights in each cell, each with its own seed"""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """from which the seed of each flight follows"""
    vehicles: int = Field(default=1, ge=1, le=8)
    """vehicles that fly together in each flight, as for `quadlab fly --vehicles`"""
    board: str = "mikrokopter"
    """the vehicle's board, as for `quadlab fly --board`"""
    law: str = ""
    """the control law; empty for the default"""
    estimator: str = ""
    """the estimator; empty for the default"""
    true_state: bool = False
    """whether the controller gets the true state instead of the estimate"""
    plugins: str = ""
    """folder of your own laws and estimators; empty for that of the data folder"""
    faults: str = ""
    """faults with schedules in every flight"""
    fixed: dict[str, Value] = Field(default_factory=dict)
    """parameters of every flight, by name"""
    factors: dict[str, Factor] = Field(default_factory=dict)
    """parameters that differ from cell to cell, by name"""
    cases: Cases = Field(default_factory=dict)
    """settings that belong together: by the name of a factor, its cases and their settings"""
    design: Design = "grid"
    """how cells are made of the factors"""
    samples: int | None = Field(default=None, ge=1)
    """cells of a sampled design: random, latin_hypercube, sobol; saltelli has more of them"""
    correlations: list[Correlation] = Field(default_factory=list)
    """pairs of factors that are not independent, in a sampled design"""
    metrics: list[str] = Field(default_factory=list)
    """the metrics to keep; empty for all"""
    limits: dict[str, float] = Field(default_factory=dict)
    """metrics with the largest value that passes, in addition to the experiment's own limits"""
    time_limit: float = Field(default=600.0, ge=1.0, le=86_400.0)
    """s of wall time after which a flight is ended"""
    keep: Keep = Keep()
    search: Search | None = None
    """a search for the best parameters, instead of a fixed number of cells"""

    @validator(mode="after")
    def _fits(self) -> Plan:
        self.factors = with_cases(self)
        if (self.samples is None) == (self.design in SAMPLED):
            what = "needs samples = …" if self.samples is None else "has no samples"
            raise ValueError(f'design = "{self.design}" {what}: {", ".join(SAMPLED)} have them')
        if self.samples and not self.factors:
            raise ValueError(f'design = "{self.design}" needs factors')
        if (
            self.design in ("sobol", SALTELLI)
            and self.samples
            and self.samples & (self.samples - 1)
        ):
            near = 2 ** (self.samples.bit_length() - 1)
            raise ValueError(
                f"samples = {self.samples} is no power of 2, as a Sobol' sequence needs: take "
                f"{near} or {2 * near}"
            )
        if self.design not in SAMPLED:
            for name, factor in self.factors.items():
                if not isinstance(factor, list) and factor.number is None:
                    raise ValueError(f'factors."{name}" needs number = … for {self.design}')
        if both := self.fixed.keys() & self.factors.keys():
            raise ValueError(f"{', '.join(sorted(both))} is both fixed and a factor; remove one")
        if self.vehicles > 1 and self.experiment == COMPILED:
            raise ValueError(f"vehicles = {self.vehicles}: {COMPILED} flies one vehicle")
        if self.vehicles > 1 and self.keep.logs != "none":
            raise ValueError(
                f"vehicles = {self.vehicles}: logs of several vehicles are not kept; leave out "
                "keep.logs, and fly the flights again that you want to see (quadlab campaign show)"
            )
        if self.correlations:
            self._fits_correlations()
        if self.search is not None:
            self._fits_search(self.search)
        over_logs.check_fits(self)
        return self

    def _fits_correlations(self) -> None:
        if self.design not in SAMPLED or self.design == SALTELLI:
            raise ValueError(
                f'correlations: design = "{self.design}" has independent factors; take random, '
                "latin_hypercube or sobol"
            )
        correlation_matrix(self.correlations, list(self.factors))

    def _fits_search(self, search: Search) -> None:
        if both := search.parameters.keys() & (self.fixed.keys() | self.factors.keys()):
            names = ", ".join(sorted(both))
            raise ValueError(f"{names} is searched, and fixed or a factor; remove one")
        if self.metrics and (lost := [n for n in search.metrics if n not in self.metrics]):
            raise ValueError(f"metrics does not keep {', '.join(lost)}, which the search needs")

    @property
    def varied(self) -> tuple[str, ...]:
        """Return the names of what differs between flights: searched parameters, then factors."""
        return (*(self.search.parameters if self.search else ()), *self.factors)


VALUE_KINDS = "bool", "int", "float", "str"
"""Names of what a value can be, as errors have them."""


@dataclass(frozen=True)
class PlanFile:
    """A plan, its text, and the folder to which the names of files in it are relative.

    Attributes:
        is_kept: whether the folder is a campaign's, with copies of these files in OWN.
    """

    plan: Plan
    text: str
    folder: Path
    is_kept: bool = False

    @property
    def experiment(self) -> str:
        """Return the experiment as `quadlab fly` takes it."""
        name = self.plan.experiment
        return str(self._file(name, Path(name).name)) if self._is_own else name

    @property
    def plugins(self) -> Path | None:
        """Return the folder of one's own laws and estimators, None for that of the data folder."""
        return self._file(self.plan.plugins, "plugins") if self.plan.plugins else None

    @property
    def logs(self) -> list[Value]:
        """Return the recorded flights that are read, none of a plan that flies."""
        found = self.plan.factors.get(over_logs.LOG, [])
        return found if self.plan.logs and isinstance(found, list) else []

    def with_logs(self, logs: Sequence[Value]) -> PlanFile:
        """Return the plan with these logs."""
        factors = {**self.plan.factors, over_logs.LOG: list(logs)}
        return replace(self, plan=self.plan.model_copy(update={"factors": factors}))

    @property
    def _is_own(self) -> bool:
        from console.experiments.user_file import is_file

        simulated = self.plan.experiment not in (COMPILED, *over_logs.KINDS)
        return simulated and is_file(self.plan.experiment)

    def _file(self, name: str, kept: str) -> Path:
        place = Path(OWN) / kept if self.is_kept else Path(name).expanduser()
        return (self.folder / place).absolute()

    def keep_files(self, folder: Path) -> None:
        """Copy the files that the plan names, and the list of its logs, into a campaign."""
        if self.plan.logs:
            over_logs.keep(folder / OWN, self.logs)
        for one in self.own_files():
            is_plugin = self.plugins is not None and one.parent == self.plugins
            place = folder / OWN / ("plugins" if is_plugin else "")
            place.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(one, place / one.name)

    def own_files(self) -> list[Path]:
        """Return the Python files that the plan names. Raises StorageError if one is missing."""
        found = [Path(self.experiment)] if self._is_own else []
        if self.plugins is not None:
            if not self.plugins.is_dir():
                raise StorageError(f"plugins: there is no folder {self.plugins}; correct the plan")
            found += sorted(one for one in self.plugins.iterdir() if one.is_file())
        for one in found:
            if not one.is_file():
                raise StorageError(f"experiment: there is no file {one}; correct the plan")
        return found

    @cached_property
    def identity(self) -> str:
        """Return a name of all that the rows depend on: the plan, and the files that it names.

        More logs are more rows of the same campaign.
        """
        without = {"factors": {over_logs.LOG}} if self.plan.logs else {}
        dumped = self.plan.model_dump(mode="json", by_alias=True, exclude=without)
        what = json.dumps(dumped, sort_keys=True)
        made = hashlib.sha256(what.encode())
        for one in self.own_files():
            made.update(one.read_bytes())
        return made.hexdigest()[:16]


def read_plan(path: Path, *, is_kept: bool = False) -> PlanFile:
    """Return the plan of a file, or of a campaign. Raises StorageError, UsageError."""
    advice = "quadlab campaign new writes a plan"
    with os_errors(lambda why: f"the plan {path} cannot be read ({why}); {advice}"):
        data = path.read_bytes()
    try:
        text = data.decode("utf-8-sig")  # some editors write a mark at the beginning
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is no UTF-8 text: byte {error.start}; save it as UTF-8") from None
    return parse_plan(text, path, is_kept=is_kept)


def parse_plan(text: str, path: Path, *, is_kept: bool = False) -> PlanFile:
    """Return the plan of a text, which is that of the file `path`. Raises UsageError."""
    try:
        plan = Plan.model_validate(tomllib.loads(text))
        if plan.logs:
            plan = over_logs.expanded(plan, path.parent, path.parent / OWN if is_kept else None)
        return PlanFile(plan, text, path.parent, is_kept)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is not TOML: {error}") from None
    except ValidationError as error:
        raise UsageError(f"{path}: {_said(error)}") from None


def _said(error: ValidationError) -> str:
    first, *others = error.errors()
    if first["loc"] and first["loc"][-1] in VALUE_KINDS:  # one value, refused as each kind
        first = first | {"loc": first["loc"][:-1], "type": "value"}
        others = [one for one in others if one["loc"][:-1] != first["loc"]]
    place = [str(part) for part in first["loc"] if part not in ("list", "range", "distribution")]
    where = ".".join(f'"{part}"' if "." in part else part for part in place)
    said = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        known = _fields(place[:-1])
        said = did_you_mean(place[-1], known) or f"known are {', '.join(known)}"
        said = f"is not known; {said}"
    elif first["type"] == "missing":
        said = "is missing"
    elif first["type"] == "value":
        said = f"{first['input']!r} is no value; take a finite number, a text, true or false"
    elif first["type"] == "too_short" and not first["input"]:
        said = "is empty; write a value, or leave it out"
    elif first["type"] not in ("value_error",):
        said = f"{said[0].lower()}{said[1:]}, not {first['input']!r}"
    more = f" (and {len(others)} more)" if others else ""
    return f"{where}: {said}{more}" if where else f"{said}{more}"


def _fields(place: list[str]) -> list[str]:
    models: dict[str, type[BaseModel]] = {"keep": Keep, "factors": Range, "search": Search}
    model = models.get(place[0] if place else "", Plan)
    return [field.alias or name for name, field in model.model_fields.items()]
