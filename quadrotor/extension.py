"""The declaration of an extension: what it offers, by names and sentences, and where its code is.

An extension is a folder with a module `extension.py`, whose `EXTENSION` is an `Extension`. Reading
it imports no code of the extension: each offer names its code by a `target`, which is imported
when a user needs it (`quadrotor.extensions`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import ClassVar

PROTOCOL = 1
"""Version of these declarations. It changes when an older declaration is no longer understood."""


class Group(StrEnum):
    """A heading of `quadlab --help`."""

    FLY = "Fly"
    RECORDED = "Recorded flights"
    SET_UP = "Set up"
    PROCESS = "Run one process (quadlab up starts what it needs)"


class Evidence(StrEnum):
    """The kinds of evidence that an extension works."""

    SIMULATED = "simulated"
    PEER = "peer"
    """A program or data of others."""
    FIRMWARE = "firmware"
    """The firmware of a board, run on this computer."""
    HARDWARE = "hardware"


@dataclass(frozen=True, slots=True)
class Judged:
    """One way in which an extension was tried.

    Attributes:
        evidence: the kind of evidence.
        by: the program, data or device, with its version; for hardware, also the date and place.
    """

    evidence: Evidence
    by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """One thing that an extension adds, under a name that no other offer of this kind has.

    Attributes:
        name: the name by which users choose it.
        target: module and name of its code, as ".command:Export"; a module that begins with a dot
            is one of the package that declares it.
    """

    kind: ClassVar[str]
    is_file: ClassVar[bool] = False
    """True for a target that is a file, without a name in it."""
    name: str
    target: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Command(Offer):
    """A command of `quadlab`, or an action of a command that has actions.

    The target is a dataclass of options with `run() -> int`.

    Attributes:
        name: the word after `quadlab`; two words for an action, as in "log import".
        summary: the sentence of `quadlab --help`, which is also the first one of the target's
            docstring.
        group: the heading under which it is listed; an action has none.
        examples: command lines and what they do.
    """

    kind: ClassVar[str] = "command"
    summary: str
    group: Group | None = None
    examples: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise ValueError unless a command has a group, and an action has none."""
        if (self.group is None) != (" " in self.name):
            raise ValueError(
                f"the command {self.name!r} needs a group, or, as an action of another command, a "
                "name of two words without a group"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PluginFormat(Offer):
    """A format of files in the folder `plugins`, beside Python; the name is the ending, as ".fmu".

    The target has the functions of `vehicle.plugins.formats.Format`.

    Attributes:
        plugins: the kinds of plugins that such a file can be.
    """

    kind: ClassVar[str] = "plugin format"
    plugins: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Importer(Offer):
    """A format of recorded flights that `quadlab log import` reads; the name is the format's.

    The target is a function of a path and the names of the tables that are wanted, which returns
    the opened file as an `extensions.importers.readers.tables.Source`.

    Attributes:
        starts: the first bytes of such files, by which they are recognised.
        pattern: a regular expression of how such files begin, where no bytes are the same in all
            of them; asked after `starts` of all formats.
    """

    kind: ClassVar[str] = "importer"
    starts: tuple[bytes, ...] = ()
    pattern: bytes = b""

    def __post_init__(self) -> None:
        """Raise ValueError for a format that cannot be recognised."""
        if not any(self.starts) and not self.pattern:
            raise ValueError(f"the importer {self.name!r} needs starts or a pattern")


@dataclass(frozen=True, slots=True, kw_only=True)
class Exporter(Offer):
    """A format of tables, for `quadlab log export --format NAME`.

    The target is a function of folder, name and metadata of a run that returns an
    `extensions.export.formats.Format`.
    """

    kind: ClassVar[str] = "exporter"


@dataclass(frozen=True, slots=True, kw_only=True)
class PageExporter(Offer):
    """A format in which a browser shows a whole run, for `quadlab log export --format NAME`.

    The target is a function of the log, the new folder, a function that is told the share done, and
    expressions of derived signals, which returns the files.
    """

    kind: ClassVar[str] = "exporter of pages"


@dataclass(frozen=True, slots=True, kw_only=True)
class Board(Offer):
    """A kind of flight board, for `--board NAME`; the target is a `vehicle.boards.kind.Kind`."""

    kind: ClassVar[str] = "board"


@dataclass(frozen=True, slots=True, kw_only=True)
class Link(Offer):
    """A kind of link to a board, for `--serial`; the name is the word before `://`.

    The target is a function of the whole word that returns a `vehicle_link.serial.port.Port`, and
    raises LinkError.

    Attributes:
        example: a link, for messages.
    """

    kind: ClassVar[str] = "link"
    example: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSystem(Offer):
    """A laboratory's tracking system, for `quadlab tracker NAME` and `quadlab up --tracker NAME`.

    The target is a `console.trackers.source.System`, or, with options, a class of one that is made
    of them.

    Attributes:
        port: the usual port of its server; 0 for a system without an address.
        library: the module without which it cannot work; "" for none.
        options: names, in the same way, a dataclass of what it adds to the options of `quadlab
            tracker`; "" for none.
        bearings: whether it measures bearings to beacons from one vehicle, instead of poses.
    """

    kind: ClassVar[str] = "tracking system"
    port: int = 0
    library: str = ""
    options: str = ""
    bearings: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ServedSystem(Offer):
    """A tracking system's server, by which the simulator serves its poses.

    The target is a function of the vehicles' names and the port, which returns a
    `vehicle.simulator.tracking_systems.frame.Server`.

    Attributes:
        port: the usual port.
    """

    kind: ClassVar[str] = "served system"
    port: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedSensor(Offer):
    """A sensor of a flight in simulated time; the name is the group of its parameters.

    The target is a `quadlab.simulated.sensors.Make`; `parameters` names a
    `quadrotor.parameters.Parameters` in the same way.
    """

    kind: ClassVar[str] = "simulated sensor"
    parameters: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Function(Offer):
    """A function of the package, `quadlab.NAME`; the target is the function."""

    kind: ClassVar[str] = "function of quadlab"


@dataclass(frozen=True, slots=True, kw_only=True)
class PageFeature(Offer):
    """Routes of the web process, below `/api/NAME/`; a websocket is at `/NAME`.

    The target is a `web.feature.Feature`.
    """

    kind: ClassVar[str] = "feature of the page"


@dataclass(frozen=True, slots=True, kw_only=True)
class PageDocument(Offer):
    """A document of the page, at `/NAME`; documents and panels that lead to it ask whether it is
    there (`core/vehicle_path.js`).

    The target is a file of the folder `page` beside the declaration, as "page/replay.html".

    Attributes:
        path: what follows the name in its address, as "/{run_id}"; "" for nothing.
    """

    kind: ClassVar[str] = "document of the page"
    is_file: ClassVar[bool] = True
    path: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PagePanel(Offer):
    """A part of the page: a tab, or a section of a place that a document of the page has.

    The target is a script of the folder `page` beside the declaration, and the function in it that
    shows the panel, as "page/tune.js:show".

    Attributes:
        place: "tabs", or the place of a section; title: the label of the tab, or section.
        styles: stylesheets of the folder; icon: of a tab, the path of an SVG on 20 × 20.
        after: the tab after which it stands; "" for the last one.
    """

    kind: ClassVar[str] = "panel of the page"
    place: str
    title: str
    styles: tuple[str, ...] = ()
    icon: str = ""
    after: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Law(Offer):
    """A control law of the vehicle's tick, for `control.law`.

    The target is a `control.laws.CompiledLaw`; `parameters` names a
    `quadrotor.parameters.Parameters` in the same way, "" for none: they are `control.NAME.FIELD`.
    """

    kind: ClassVar[str] = "control law"
    parameters: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimator(Offer):
    """An estimator of the vehicle's state, for `estimation.estimator` and `estimation.shadow`.

    The target is a function of the `estimation.parameters.EstimationParameters` that returns an
    `estimation.estimator.Estimator`.
    """

    kind: ClassVar[str] = "estimator"


@dataclass(frozen=True, slots=True, kw_only=True)
class StationPart(Offer):
    """A part of the base station of each vehicle; the name is the group of its parameters.

    The target is a function of a `console.part.PartContext` that returns a `console.part.Part`;
    `parameters` names a `quadrotor.parameters.Parameters` in the same way, "" for none.
    """

    kind: ClassVar[str] = "part of the station"
    parameters: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutSurvey(Offer):
    """A survey of the beacons from a flight; the target is a `web.beacons.survey.SurveyRun`."""

    kind: ClassVar[str] = "survey of the beacons"


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment(Offer):
    """An experiment, for `quadlab fly NAME` and the page; a calibration also for `calibrate`.

    The target is a function of the vehicle's name that returns a
    `console.experiments.client.Experiment` of the same name.

    Attributes:
        calibration: the name of the calibration that it proposes; "" for none.
    """

    kind: ClassVar[str] = "experiment"
    calibration: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportWriter(Offer):
    """The writer of reports of runs; the target is a `console.reports.writer.Write`."""

    kind: ClassVar[str] = "writer of reports"


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation(Offer):
    """A reader of logs that finds what happened in a flight and why.

    The target is a `console.evaluation.findings.Explain`.
    """

    kind: ClassVar[str] = "explanation"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFigures(Offer):
    """Figures of a report; the target is an `extensions.reports.experiment_figures.Maker`.

    The name is that of the experiment.
    """

    kind: ClassVar[str] = "figures of the report"


@dataclass(frozen=True, slots=True, kw_only=True)
class Extension:
    """The declaration of an extension.

    Attributes:
        name: its name, which is the name of its folder.
        summary: one sentence for tables of extensions.
        protocol: the version of the declarations for which it was written.
        offers: what it adds.
        judged: how it was tried.
        needs: names of the extensions whose code it imports.
        libraries: modules of other distributions without which it cannot work, and the extra of
            quadlab, or the distribution, that installs each.
        docs: its page below `docs`, or its address.
    """

    name: str
    summary: str
    protocol: int
    offers: tuple[Offer, ...]
    judged: tuple[Judged, ...] = ()
    needs: tuple[str, ...] = ()
    libraries: Mapping[str, str] = field(default_factory=dict)
    docs: str = ""
