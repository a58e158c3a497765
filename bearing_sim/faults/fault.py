"""Faults as data: how one is declared, written in a text, and run by its schedule.

A text holds any number of faults, separated by semicolons: a name, values, and the words of a
schedule, like `tracker.freeze what=position from=3 to=4; tracker.delay value=0.1 ramp=5`. The name
of a live parameter with `value` moves that parameter by the same schedules.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from bearing_sim.faults.schedule import WORDS, Moment, Schedule, stream_of
from quadrotor.errors import OutOfBoundsError, ParameterError
from quadrotor.parameter_description import ParameterDescription, parse_text
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.similar_names import did_you_mean

Memory = dict[Any, Any]
"""The state that a fault keeps while it is on; empty when it comes on."""
LISTED = "docs/how_to/faults.md lists them all"
VALUE = "value"
"""Word for the value of a parameter that is moved."""
OF_SIMULATOR = "simulator.faults"
HOMES = {
    "tracker": "tracker.faults",
    "bearings": "bearings.faults",
    **dict.fromkeys(("imu", "barometer", "battery", "motors", "vehicle", "world"), OF_SIMULATOR),
    "simulator": OF_SIMULATOR,
}
"""Parameter that takes the faults of a subject, the part of a name before the first dot."""


class Fault(Parameters):
    """Base of all declarations: a docstring with the physics in one sentence, and parameters.

    Attributes:
        name: subject and fault, as it is written.
        source: where the physics comes from.
        of: parameters that tell apart what it acts on, a motor for instance; two such faults may
            be on at the same time.
        varies: whether it changes while it is on at one level, by time, place or chance.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    of: ClassVar[tuple[str, ...]] = ()
    varies: ClassVar[bool] = False


class Moved(Fault):
    """A parameter is moved to a value, by the share that the schedule has reached."""

    name: ClassVar[str] = "parameter"
    source: ClassVar[str] = "the parameter itself"
    of: ClassVar[tuple[str, ...]] = ("parameter",)

    parameter: str = ""
    to: Any = None

    def move(self, parameters: Parameters, level: float) -> None:
        """Move the parameter of this component; what is no number changes at any level above 0."""
        *path, last = self.parameter.split(".")
        owner = parameters
        for one in path:
            setattr(owner, one, getattr(owner, one).model_copy())
            owner = getattr(owner, one)
        before = getattr(owner, last)
        if isinstance(before, float):
            setattr(owner, last, before + level * (self.to - before))
        elif level > 0.0:
            setattr(owner, last, self.to)


@dataclass(frozen=True)
class Entry:
    """A fault of a text.

    Attributes:
        text: as it was written, with single spaces.
        key: name, and what it acts on.
    """

    text: str
    key: str
    fault: Fault
    schedule: Schedule


@dataclass(frozen=True)
class Catalogue:
    """The faults that one parameter `faults` takes.

    Attributes:
        home: name of that parameter, like `simulator.faults`.
        faults: declarations by name.
        lacking: why some of them are impossible here, by name.
    """

    home: str
    faults: Mapping[str, type[Fault]]
    lacking: Mapping[str, str] = field(default_factory=dict)

    def parse(self, text: str, parameters: Parameters) -> tuple[Entry, ...]:
        """Return the faults of a text.

        Args:
            parameters: the component that has the parameter `faults`.

        Raises OutOfBoundsError with the entry, what is allowed and what to try.
        """
        parts = [" ".join(part.split()) for part in text.split(";")]
        entries = [self._entry(part, parameters) for part in parts if part]
        for k, one in enumerate(entries):
            for other in entries[:k]:
                if one.key == other.key and _overlap(one.schedule, other.schedule):
                    raise OutOfBoundsError(
                        f"{self.home}: {other.text!r} and {one.text!r} overlap: end the first "
                        "before the second begins, or leave one out"
                    )
        return tuple(entries)

    def _entry(self, text: str, parameters: Parameters) -> Entry:
        name, *words = text.split(" ")
        try:
            declared, described = self._declared(name, parameters)
            values, times = _read(words, described)
            if declared is Moved:
                if VALUE not in values:
                    raise OutOfBoundsError(f"it needs {VALUE}, like {name} {VALUE}=1 from=3")
                of = name.removeprefix(self._prefix)
                fault: Fault = Moved(parameter=of, to=values[VALUE])
            else:
                fault = declared()
                ParameterStore(fault).preset(values)
            schedule = Schedule()
            ParameterStore(schedule).preset(times)
        except ParameterError as error:
            raise OutOfBoundsError(f"{self.home}: {text!r:.100}: {error}") from None
        acts_on = [str(getattr(fault, one)) for one in fault.of]
        return Entry(text, " ".join([name, *acts_on]), fault, schedule)

    @property
    def _prefix(self) -> str:
        return self.home.removesuffix("faults")

    def _declared(
        self, name: str, parameters: Parameters
    ) -> tuple[type[Fault], Mapping[str, ParameterDescription]]:
        """Return the declaration and what it takes. Raises OutOfBoundsError."""
        if name in self.lacking:
            raise OutOfBoundsError(self.lacking[name])
        if name in self.faults:
            declared = self.faults[name]
            store = ParameterStore(declared())
            return declared, {one.name: one for one in store.descriptions()}
        movable = movable_parameters(parameters, self._prefix)
        if name in movable:
            return Moved, {VALUE: movable[name]}
        home = HOMES.get(name.partition(".")[0], self.home)
        if home != self.home:
            raise OutOfBoundsError(f"it belongs in {home}")
        hint = did_you_mean(name, (*self.faults, *movable), after=" ", cutoff=0.5)
        raise OutOfBoundsError(f"no fault is called {name!r}: {hint}{LISTED}")


def movable_parameters(parameters: Parameters, prefix: str) -> dict[str, ParameterDescription]:
    """Return the parameters of a component that a schedule can move, by their whole names."""
    described = ParameterStore(parameters).descriptions()
    fixed = ("faults", "seed")
    return {
        prefix + one.name: one
        for one in described
        if not one.read_only and one.name not in fixed and (one.type != "str" or one.choices)
    }


def _read(
    words: Sequence[str], described: Mapping[str, ParameterDescription]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the values of the fault and those of its schedule. Raises ParameterError."""
    values: dict[str, Any] = {}
    times: dict[str, Any] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or name not in {*described, *WORDS}:
            raise OutOfBoundsError(
                f"{word!r} is not understood; it takes {', '.join([*described, *WORDS])}, each "
                "as name=value"
            )
        if name in values or name in {one.rstrip("_") for one in times}:
            raise OutOfBoundsError(f"{name} is given twice")
        if name in described:
            values[name] = parse_text(described[name], text)
        else:
            times[name if name in Schedule.model_fields else f"{name}_"] = parse_text(
                WORDS[name], text
            )
    return values, times


def _overlap(one: Schedule, other: Schedule) -> bool:
    return one.begin_ns < other.end_ns and other.begin_ns < one.end_ns


@dataclass
class Running:
    """A fault on its own clock, which began at `origin_ns`, with its memory of this spell."""

    entry: Entry
    origin_ns: int
    stream: int
    memory: Memory = field(default_factory=dict)
    spell_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Active:
    """A fault that is on."""

    fault: Fault
    moment: Moment
    memory: Memory


class Faults:
    """The faults of one component in their schedules.

    A fault's clock begins when it is set. An entry that stays as it is while others come and go
    keeps its clock.

    Attributes:
        text: the text that was set.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self.text = ""
        self._catalogue = catalogue
        self._running: list[Running] = []

    def set(self, text: str, parameters: Parameters, now_ns: int) -> None:
        """Run the faults of this text from now on. Raises OutOfBoundsError."""
        entries = self._catalogue.parse(text, parameters)
        before = {one.entry.text: one for one in self._running}
        self._running = [
            before.get(one.text) or Running(one, now_ns, stream_of(one.key)) for one in entries
        ]
        self.text = text

    def __bool__(self) -> bool:
        return bool(self._running)

    def active(self, now_ns: int, seed: int) -> list[Active]:
        """Return the faults that are on, in the order of the text.

        A clock that has gone back is that of a new simulation, in which the faults begin anew.
        """
        found = []
        for one in self._running:
            one.origin_ns = min(one.origin_ns, now_ns)
            moment = one.entry.schedule.at(now_ns - one.origin_ns, seed, one.stream)
            if moment is None:
                continue
            if moment.spell_ns != one.spell_ns:
                one.spell_ns, one.memory = moment.spell_ns, {}
            found.append(Active(one.entry.fault, moment, one.memory))
        return found


def moved(parameters: Any, active: Sequence[Active]) -> Any:
    """Return a copy of the parameters with the changes of the active faults; the same object if
    there are none.
    """
    movers = [one for one in active if isinstance(one.fault, Moved)]
    if not movers:
        return parameters
    copied = parameters.model_copy()
    for one in movers:
        assert isinstance(one.fault, Moved)
        one.fault.move(copied, one.moment.level)
    return copied


def by_home(text: str) -> dict[str, str]:
    """Return the text of each parameter that takes faults, from one text of all."""
    found: dict[str, list[str]] = {}
    for part in filter(None, (" ".join(one.split()) for one in text.split(";"))):
        home = HOMES.get(part.partition(".")[0], OF_SIMULATOR)
        found.setdefault(home, []).append(part)
    return {home: "; ".join(parts) for home, parts in found.items()}
