"""The title of a run, from what was flown and changed while it was recorded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from quadrotor.parameter_description import ParameterValue
from vehicle_link.clock import monotonic

PLAIN = ("take_off", "hover", "land", "brake")
"""Behaviors of every flight, which tell no flight from another: how long is said without others."""
NAMES = {"figure_eight": "figure 8", "figure_eight_lap": "figure 8 lap", "excite": "step test"}
"""Names of behaviors and trajectories in the words of a title."""
MOST = 3
"""Number of changed parameters that are named."""
LONGEST = 24
"""Longest value of a parameter that is shown, in characters."""


class RunTitle:
    """Behaviors flown and parameters changed during one run; called from any thread."""

    def __init__(self) -> None:
        self._flown: Counter[str] = Counter()
        self._first: dict[str, ParameterValue] = {}
        self._last: dict[str, ParameterValue] = {}
        self._air: list[float] = []  # s, of take-offs and landings in turn

    def started(self, behavior: str, arguments: Mapping[str, ParameterValue]) -> None:
        """Note a behavior that the vehicle accepted."""
        which = str(arguments.get("trajectory", behavior))
        if behavior not in PLAIN:
            self._flown[NAMES.get(which, which.replace("_", " "))] += 1
        elif (behavior == "land") == len(self._air) % 2:  # the next in turn
            self._air.append(monotonic())

    def changed(self, name: str, old: ParameterValue, new: ParameterValue) -> None:
        """Note the change of a parameter, but of none that only runs in parallel."""
        if ".shadow" not in name:
            self._first.setdefault(name, old)
            self._last[name] = new

    def text(self) -> str:
        """Return the title, as "Figure 8 × 1, step tests × 2, kp_xy 4 → 13" or "Hover 2 min".

        A parameter that was changed and changed back is left out. It is "" where nothing happened.
        """
        counts, last = dict(self._flown), dict(self._last)  # other threads go on
        flown = [f"{words}{'s' if count > 1 else ''} × {count}" for words, count in counts.items()]
        air = list(self._air)
        air += [monotonic()] * (len(air) % 2)
        hover = sum(air[1::2]) - sum(air[::2])
        if air and not flown:
            flown = [f"hover {hover:.0f} s" if hover < 90.0 else f"hover {hover / 60.0:.0f} min"]
        moved = [name for name, new in last.items() if new != self._first[name]]
        named = [_change(name, self._first[name], last[name]) for name in moved[:MOST]]
        more = [f"{len(moved) - MOST} more changes"] if len(moved) > MOST else []
        title = ", ".join((*flown, *named, *more))
        return f"{title[0].upper()}{title[1:]}" if flown else title


def _change(name: str, old: ParameterValue, new: ParameterValue) -> str:
    values = [_shown(old), _shown(new)]
    if max(map(len, values)) > LONGEST:
        return f"{name} changed"
    return f"{name.rpartition('.')[2]} {' → '.join(values)}"


def _shown(value: ParameterValue) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
