"""Signals made from the message types: all numbers of messages that have no named signal."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from vehicle_link.messages.units import Path, numbers, unit_of
from vehicle_link.topics.table import TOPICS
from web.signals.signal import Scaled, Signal, Source, scaled

MEMBERS = 8
"""Members shown of an array of variable length: beacons, axes of sticks, cells of a battery."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """One number of a message, with its label, group and unit."""

    name: str  # `pose.covariance.0`
    column: str  # `pose.covariance[0]`
    label: str
    group: str
    unit: str


def leaves(type_name: str, covered: Collection[str] = ()) -> list[Leaf]:
    """Return the numbers of a message of this type (`quadlab_msgs/LinkStatus`), in its order.

    Args:
        covered: columns that are left out, with all below them.
    """
    found = []
    for path, fields in numbers(type_name, MEMBERS):
        name = ".".join(str(step) for step in path)
        column = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in path).lstrip(".")
        if any(column == c or column.startswith((f"{c}.", f"{c}[")) for c in covered):
            continue
        *outer, last = _words(path)
        found.append(Leaf(name, column, last, " ".join(outer), unit_of(fields)))
    return found


def _words(path: Path) -> list[str]:
    """Return the words of a path: `pose`, `covariance 7` of `pose.pose.covariance.7`.

    An index joins the word before it, because it means nothing alone.
    """
    words: list[str] = []
    for step in path:
        if isinstance(step, int):
            words[-1] += f" {step}"
        elif step not in words:
            words.append(step.replace("_", " "))
    return words


def sources_of(topic: str, covered: Collection[str]) -> list[Source]:
    """Return one source for each group of numbers, so that only requested ones are read."""
    groups: dict[str, list[Leaf]] = {}
    for leaf in leaves(TOPICS[topic].type_name, covered):
        groups.setdefault(leaf.group, []).append(leaf)
    return [_source(topic, group, members) for group, members in groups.items()]


def _source(topic: str, group: str, members: Sequence[Leaf]) -> Source:
    title = group or topic.replace("_", " ")
    return scaled(
        *(
            Scaled(Signal(f"{topic}.{leaf.name}", leaf.label, leaf.unit, title, topic), leaf.column)
            for leaf in members
        )
    )
