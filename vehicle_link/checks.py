"""One check's result, as either end of the link finds it and the page shows it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Literal

from vehicle_link.messages import new, records

State = Literal["ok", "warn", "fail", "unknown"]
Place = Literal["station", "vehicle", "page"]
PLACES: dict[str, Place] = {"station": "station", "vehicle": "vehicle", "page": "page"}
STATES: tuple[State, ...] = ("ok", "warn", "fail", "unknown")


@dataclass(frozen=True, slots=True)
class Check:
    """A check and its result.

    state: `warn` deserves attention, `fail` must be fixed, `unknown` could not be checked.
    found, wanted: the value found and the value required, in words with figure and limit.
    advice: what to do; shown unless the state is ok.
    """

    name: str
    state: State
    found: str
    wanted: str = ""
    advice: str = ""
    place: Place = "station"


def to_messages(checks: Iterable[Check]) -> list[records.Check]:
    """Encode each check as a quadlab_msgs/Check."""
    shown = (replace(one, advice="") if one.state == "ok" else one for one in checks)
    return [new("quadlab_msgs/Check", **asdict(one)) for one in shown]


def from_messages(messages: Iterable[records.Check]) -> list[Check]:
    """Decode checks; a state that this version does not define becomes `unknown`."""
    return [
        Check(
            str(one.name),
            one.state if one.state in STATES else "unknown",
            str(one.found),
            str(one.wanted),
            str(one.advice),
            PLACES.get(one.place, "station"),
        )
        for one in messages
    ]
