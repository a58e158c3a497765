"""Behaviors that the Fly tab starts, with their arguments as the vehicle describes them."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache
from typing import Any

from control.behaviors.arguments import ARGUMENTS
from quadrotor.parameters import Parameters, ParameterStore
from web.static_files import STATIC


@cache
def described() -> list[dict[str, Any]]:
    """Return the rows of `static/fly/behaviors.json` with described arguments.

    Each argument has type, start value, bounds and unit. A row may set another start value; an
    empty one leaves it to the vehicle.
    """
    rows: list[dict[str, Any]] = json.loads((STATIC / "fly/behaviors.json").read_text())
    for row in rows:
        form = ParameterStore(ARGUMENTS.get(row["name"], Parameters)())
        row["arguments"] = [
            {**asdict(form.description(one["name"])), **one} for one in row["arguments"]
        ]
    return rows
