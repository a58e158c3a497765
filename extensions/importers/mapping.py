"""Mappings: the meaning of a file's columns, with their frames and units (TOML).

What a mapping states is checked; what it leaves out is found by `extensions.importers.checks`.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from estimation.parameters import EstimationParameters
from extensions.importers.frames import axes
from quadrotor.errors import LogFormatError, ParameterError, UsageError
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.similar_names import did_you_mean

HERE = Path(__file__).parent / "mappings"
ORDERS = {"wxyz": [0, 1, 2, 3], "xyzw": [3, 0, 1, 2]}

Columns = str | int | list[str | int]
Positive = Annotated[float, Field(gt=0.0)]


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Rows(Strict):
    """Rows of a table with their time."""

    file: str = ""  # next to the imported file; default: the imported file
    table: str = ""
    time: str | int | None = None
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    rate: Positive | None = None  # Hz, for rows without a time
    time_offset: float | Literal["motion"] | None = None  # s, added to the stamps
    time_scale: Positive = 1.0  # of this clock to the IMU's
    optional: bool = False  # left out if the file has no such table


class ImuRows(Rows):
    angular_velocity: Columns
    angular_velocity_unit: Literal["rad/s", "deg/s", "mdeg/s"] | Positive | None = None
    specific_force: Columns
    specific_force_unit: Literal["m/s^2", "g", "mg"] | Positive | None = None
    body: str | None = None


class Attitudes(Rows):
    """Attitudes as quaternions, or as Euler angles."""

    quaternion: Columns | None = None
    quaternion_order: Literal["wxyz", "xyzw"] | None = None
    quaternion_maps: Literal["body to world", "world to body"] | None = None
    euler: Columns | None = None  # in the order of euler_order
    euler_order: str | None = None  # ZYX: about the body's axes one after another; zyx: the world's
    euler_unit: Literal["deg", "rad"] | None = None

    def misfit(self) -> str:
        """Return what is wrong with the statements about the attitudes; empty if nothing is."""
        told = {"euler_order": self.euler_order, "euler_unit": self.euler_unit}
        if self.euler is None:
            named = [name for name, value in told.items() if value is not None]
            return f"{named[0]} without euler" if named else ""
        if self.quaternion is not None or self.quaternion_order is not None:
            return "quaternion and euler are both stated: give one of them"
        if missing := [name for name, value in told.items() if value is None]:
            return f"euler needs {' and '.join(missing)}"
        order = self.euler_order or ""
        apart = len(order) == 3 and order[0] != order[1] != order[2]
        if not (apart and (set(order) <= set("XYZ") or set(order) <= set("xyz"))):
            return (
                f"euler_order {order!r} is none: three letters like ZYX (about the body's axes, "
                "one after another) or zyx (about the world's) are needed"
            )
        return ""


class AttitudeRows(Attitudes):
    pass


class TrackRows(Attitudes):
    position: Columns
    position_unit: Literal["m", "cm", "mm", "ft"] | Positive | None = None
    velocity: Columns | None = None  # in world axes, position_unit per second
    attitude: AttitudeRows | None = None  # if it is in a separate table
    world: str | None = None
    body: str | None = None


CLOCK, CLOCK_TOPIC = "clock", "/clock"
"""The time by the simulated clock of ROS, and its topic."""
STAMPS = {"header": "stamp", "log": "logged", "clock": CLOCK}
"""Columns of time of a topic: its header's stamp, when it was logged, and the simulated clock."""


class BatteryRows(Rows):
    voltage: str | int


class Mapping(Strict):
    """A mapping file."""

    description: str = ""
    vehicle: str = ""
    imu: ImuRows
    truth: TrackRows | None = None
    estimate: TrackRows | None = None
    battery: BatteryRows | None = None
    parameters: dict[str, float] = {}  # with which estimators are replayed on it

    def tables(self) -> set[str]:
        """Return the names of all tables that it uses."""
        tracks = [one for one in (self.truth, self.estimate) if one]
        rows: list[Rows | None] = [self.imu, self.battery, *tracks]
        rows += [one.attitude for one in tracks]
        clock = {CLOCK_TOPIC} if any(one and one.time == CLOCK for one in rows) else set()
        return {one.table for one in rows if one} | clock

    def with_stamps(self, choice: str) -> Self:
        """Return the mapping with another one of STAMPS as the time of all topics. Raises
        UsageError where it has none.
        """
        found = self.model_copy(deep=True)
        tracks = [one for one in (found.truth, found.estimate) if one]
        rows: list[Rows | None] = [found.imu, found.battery, *tracks]
        rows += [one.attitude for one in tracks]
        topics = [one for one in rows if one and not one.file and one.time in STAMPS.values()]
        if not topics:
            raise UsageError(
                f"--stamps {choice}: no section of the mapping has a topic, with the time "
                f"{', '.join(STAMPS.values())}"
            )
        for one in topics:
            one.time = STAMPS[choice]
        return found

    def with_table(self, name: str) -> Self:
        """Return the mapping with another table in [imu], and in sections with the same table.

        A name that adds "@2" to that of [imu] adds it to those of all sections: they are tables of
        one start of the vehicle.
        """
        found = self.model_copy(deep=True)
        stem, at, number = name.partition("@")
        tracks = [one for one in (found.truth, found.estimate) if one]
        rows: list[Rows | None] = [found.battery, *tracks, *(one.attitude for one in tracks)]
        for one in rows:
            if one and not one.file and one.table == self.imu.table:
                one.table = name
            elif one and not one.file and at and stem == self.imu.table:
                one.table += at + number
        found.imu.table = name
        return found


def names() -> list[str]:
    """Return the names of the mappings that come with quadlab."""
    return sorted(path.stem for path in HERE.glob("*.toml"))


def load_mapping(chosen: str) -> Mapping:
    """Return a mapping that comes with quadlab, by name, or read one from a file.

    Raises UsageError.
    """
    path = Path(chosen)
    if chosen in names():
        path = HERE / f"{chosen}.toml"
    elif not path.is_file():
        raise UsageError(f"no mapping {chosen!r}: give a TOML file, or one of {', '.join(names())}")
    try:
        found = Mapping.model_validate(tomllib.loads(path.read_text()))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise UsageError(f"mapping {path.name} cannot be read: {error}") from None
    except ValidationError as error:
        raise UsageError(f"mapping {path.name}: {_first(error)}") from None
    for section, rows in (("imu", found.imu), ("truth", found.truth), ("estimate", found.estimate)):
        for word in ("body", "world"):
            if letters := getattr(rows, word, None):
                axes(letters, f"mapping {path.name}, [{section}] {word}")
        if rows is not None and rows.time is None and rows.rate is None:
            raise UsageError(f"mapping {path.name}: [{section}] needs time or rate")
    for section in ("truth", "estimate"):
        track = getattr(found, section)
        if track is None:
            continue
        for where, one in ((section, track), (f"{section}.attitude", track.attitude)):
            if one is not None and (why := one.misfit()):
                raise UsageError(f"mapping {path.name}: [{where}] {why}")
        if track.attitude and track.attitude.quaternion is None and track.attitude.euler is None:
            raise UsageError(f"mapping {path.name}: [{section}.attitude] needs quaternion or euler")
    try:
        ParameterStore(Replayed()).preset(found.parameters)
    except ParameterError as error:
        raise UsageError(f"mapping {path.name}: [parameters] {error}") from None
    return found


class Replayed(Parameters):
    """The parameters that a mapping may set: those of estimators."""

    estimation: EstimationParameters = EstimationParameters()


def _first(error: ValidationError) -> str:
    """Return the first mistake in a mapping as one line."""
    mistakes = error.errors()
    one = next((one for one in mistakes if one["type"] == "extra_forbidden"), mistakes[0])
    *sections, name = [str(part) for part in one["loc"]] or [""]
    where = f"[{'.'.join(sections)}] {name}" if sections else f"[{name}]"
    model: Any = Mapping
    if one["type"] == "extra_forbidden":
        for part in sections:
            model = _model(model, part)
        known = list(model.model_fields)
        hint = did_you_mean(name, known) or f"there are {', '.join(known)}"
        return f"{where} is not known; {hint}"
    if one["type"] == "missing":
        return f"{where} is missing"
    return f"{where}: {one['msg']}, not {one['input']!r:.60}"


def _model(model: Any, part: str) -> Any:
    kind = model.model_fields[part].annotation
    return next((one for one in getattr(kind, "__args__", (kind,)) if one is not type(None)), kind)


def _as_written(name: str, known: list[str]) -> str:
    """Return a name in the letters of the only column that it is but for capitals, else itself."""
    stem, bracket, rest = name.partition("[")
    stems = {one.partition("[")[0] for one in known}
    alike = [one for one in stems if one.lower() == stem.lower()]
    if name in known or stem in stems or len(alike) != 1:
        return name
    return f"{alike[0]}{bracket}{rest}"


def column_names(asked: Columns, known: list[str], count: int, where: str) -> list[str]:
    """Return the columns that a mapping names, `count` of them.

    NAME may stand for all of NAME[0], NAME[1], …, and NAME[3:7] for some of them; capitals matter
    only where two columns differ by them. Raises LogFormatError.
    """
    found: list[str] = []
    for word in asked if isinstance(asked, list) else [asked]:
        text = _as_written(str(word), known)
        part = re.fullmatch(r"(.+)\[(\d+):(\d+)\]", text)
        if text in known:
            found.append(text)
        elif part:
            found += [f"{part[1]}[{k}]" for k in range(int(part[2]), int(part[3]))]
        else:
            found += [one for one in known if re.fullmatch(re.escape(text) + r"\[\d+\]", one)] or [
                text
            ]
    if twice := [one for one in found if known.count(one) > 1]:
        raise LogFormatError(
            f"{where}: the name {twice[0]!r} is ambiguous, {known.count(twice[0])} columns are "
            "called so: rename those that are not meant"
        )
    if missing := [one for one in found if one not in known]:
        more = f" and {len(known) - 12} more" if len(known) > 12 else ""
        hint = did_you_mean(missing[0], known, cutoff=0.5)
        unnamed = f"its {len(known)} columns have no names (are there commas in numbers?); "
        listed = ", ".join(known[:12]) or "none with numbers"
        hint = hint or unnamed * (known[:1] == ["0"]) + f"there are {listed}{more}"
        raise LogFormatError(f"{where}: there is no column {missing[0]!r}; {hint}")
    if len(found) != count:
        raise LogFormatError(
            f"{where}: {count} columns are needed, {', '.join(found[:12])}"
            f"{' …' * (len(found) > 12)} are {len(found)}"
        )
    return found
