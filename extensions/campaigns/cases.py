"""Named cases of a plan: settings that belong together, as a world or a set of gains."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from extensions.campaigns.factors import Factor, Value
from extensions.campaigns.table import FIXED_COLUMNS, MACHINE
from quadrotor.similar_names import did_you_mean

if TYPE_CHECKING:
    from extensions.campaigns.plan import Plan

Cases = dict[str, dict[str, dict[str, Value]]]
"""By the name of a factor, and the name of each of its cases, the case's settings."""
TAKEN = (*FIXED_COLUMNS, "verdict", "reason", "log", "faults")
"""Names that no factor of cases may have: columns, and a setting without a dot."""


def check_name(name: str) -> None:
    """Raise ValueError for a name that a column cannot have, or that is that of a setting."""
    is_word = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII)
    if not is_word or name in TAKEN or name.startswith(MACHINE):
        raise ValueError(
            f'cases."{name}": a name has letters, digits and _, and none of the table\'s own '
            f"columns; take another one, as world or gains"
        )


def with_cases(plan: Plan) -> dict[str, Factor]:
    """Return the factors of a plan, including the factors of its cases. Raises ValueError."""
    found: dict[str, Factor] = {}
    varied = {*plan.factors, *(plan.search.parameters if plan.search else ())}
    for name, cases in plan.cases.items():
        check_name(name)
        if not cases:
            raise ValueError(f"cases.{name} has no case; write one, as [cases.{name}.calm]")
        chosen = plan.factors.get(name, list(cases))
        if not isinstance(chosen, list):
            raise ValueError(f"factors.{name}: cases are chosen by a list of their names")
        for label in map(str, chosen):
            if label not in cases:
                hint = did_you_mean(label, cases) or f"there are {', '.join(cases)}"
                raise ValueError(f"factors.{name}: there is no case {label!r}; {hint}")
        for label, settings in cases.items():
            if both := ", ".join(sorted(settings.keys() & varied)):
                raise ValueError(
                    f'cases.{name}."{label}": {both} is a factor, or searched, too; remove one'
                )
        found[name] = chosen
    return {**found, **plan.factors}


def settled(cases: Cases, name: str, value: Value) -> Mapping[str, Value]:
    """Return the settings for which a factor's value stands, in the order in which they count."""
    return cases[name][str(value)] if name in cases else {name: value}
