"""The runs that the options of `quadlab replay` ask for, and those that were flown."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal, NamedTuple

from estimation import registry
from quadlab.recording.log import Recording
from quadlab.settings import parse_settings
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import LogFormatError, ParameterError, UsageError

ESTIMATOR, SOURCE = "estimation.estimator", "estimation.source"
SHADOWS = SHADOW, SHADOW_SOURCE = "estimation.shadow", "estimation.shadow_source"
CHOICES = (ESTIMATOR, SOURCE, *SHADOWS)

EstimatorAndSource = tuple[str, str]  # estimator, source


class Choice(NamedTuple):
    """An estimator with its source, and how long it was flown on while airborne."""

    estimator: str
    source: str
    seconds: float
    begin_ns: int | None  # stamp after which it ran, as a shadow at first; None: from the start


def flown_choices(recording: Recording) -> list[Choice]:
    """Return the choices with which the flight was flown, the longest first."""
    p = recording.parameters.estimation
    chosen = {
        ESTIMATOR: p.estimator,
        SOURCE: p.source,
        SHADOW: p.shadow,
        SHADOW_SOURCE: p.shadow_source,
    }
    flying = [stamp_ns for stamp_ns, airborne in recording.airborne if airborne]
    begin_ns = flying[0] if flying else recording.start_ns
    end_ns = flying[-1] if flying else int(recording.imu["stamp_ns"][-1])

    running: dict[EstimatorAndSource, int | None] = dict.fromkeys(_pairs(chosen))
    spans: dict[EstimatorAndSource, int] = {}
    begins: dict[EstimatorAndSource, int | None] = {}

    def fly_until(stamp_ns: int) -> None:
        nonlocal begin_ns
        until_ns = min(max(stamp_ns, begin_ns), end_ns)
        flown = _pairs(chosen)[0]
        spans[flown] = spans.get(flown, 0) + until_ns - begin_ns
        begins.setdefault(flown, running[flown])
        begin_ns = until_ns

    changes = (change for change in recording.changes if change.name in CHOICES)
    for (stamp_ns, _), group in groupby(changes, key=lambda one: one[:2]):
        fly_until(stamp_ns)
        chosen |= {change.name: str(change.value) for change in group}
        running = {pair: running.get(pair, stamp_ns) for pair in _pairs(chosen)}
    fly_until(end_ns)
    longest = sorted(spans.items(), key=lambda item: -item[1])
    found = [Choice(*pair, 1e-9 * span, begins[pair]) for pair, span in longest]
    return [one for one in found if one.seconds > 0.0] or found[:1]


def _pairs(chosen: dict[str, str]) -> list[EstimatorAndSource]:
    """Return the running estimators: the one flown on, then its shadow if there is one."""
    flown = (chosen[ESTIMATOR], chosen[SOURCE])
    if chosen[SHADOW] == "none":
        return [flown]
    source = chosen[SHADOW_SOURCE]
    return [flown, (chosen[SHADOW], chosen[SOURCE] if source == "same" else source)]


On = Literal["bearings", "recorded-bearings", "poses", "both", "sweeps"]
SWEEPS = "sweeps"
"""Sweep angles of Lighthouse base stations, for the error-state filter."""
CHANGEABLE = ("estimation.", "bearings.", "tracker.", "beacons.layout")
LAYOUT, BELIEVED_LAYOUT = "bearings.layout", "beacons.layout"


@dataclass
class Run:
    """One run of an estimator over the flight."""

    label: str
    estimator: str
    parameters: FlightParameters
    source: str  # poses, bearings, both or sweeps
    emulated: frozenset[str]  # which of poses and bearings are emulated again
    fixed: frozenset[str]  # parameters that the flight's own changes do not alter
    begin_ns: int | None = None  # stamp after which it begins; None: the log's beginning

    @property
    def measurements(self) -> str:
        """Return the kinds of measurement of an estimator, for the table."""
        kinds = ("poses", "bearings") if self.source == "both" else (self.source,)
        return " + ".join(
            f"{'emulated' if kind in self.emulated else 'recorded'} {kind}" for kind in kinds
        )

    def uses(self, kind: str) -> bool:
        """Return whether it is given poses, bearings or sweeps."""
        return self.source == kind or (self.source == "both" and kind != SWEEPS)


def plan_runs(
    recording: Recording,
    estimators: Sequence[str],
    runs: Sequence[str],
    settings: Sequence[str],
    on: On | None,
) -> list[Run]:
    """Return the runs of --estimator, then those of --run; without either, the flight's own one.

    Raises UsageError; LogFormatError when the log lacks the measurements.
    """
    asked = [(name, [name]) for name in estimators]
    asked += [(text.strip(), _split(text)) for text in runs]
    if not asked:
        flown = flown_choices(recording)[0].estimator
        unset = "as flown" if recording.parameters_recorded else "with default parameters"
        asked = [(f"{flown}, {'as set' if settings or on else unset}", [])]
    planned = [_run(recording, label, words, settings, on) for label, words in asked]
    for prefix, kind in (("bearings.", "bearings"), ("tracker.", "poses")):
        named = [word for word in settings if word.startswith(prefix)]
        if named and not any(run.uses(kind) for run in planned):
            raise _unused(named[0], kind)
    return planned


def _split(text: str) -> list[str]:
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise UsageError(f"--run {text!r}: {error}; close the quotes") from None
    if not words or "=" in words[0]:
        raise UsageError(
            f"--run {text!r}: write the estimator first ({', '.join(registry.names())}), then "
            "name=value words, like --run 'complementary estimation.preset=paper'"
        )
    return words


def _run(
    recording: Recording, label: str, words: list[str], settings: Sequence[str], on: On | None
) -> Run:
    own = words[1:]
    parameters = recording.parameters.model_copy(deep=True)
    flown = flown_choices(recording)[0]
    parameters.estimation.estimator, parameters.estimation.source = flown.estimator, flown.source
    fixed = _apply(parameters, [*settings, *own])
    name = _estimator(words, parameters, fixed)
    source = parameters.estimation.source
    if SOURCE not in fixed and on is not None:
        source = "bearings" if on == "recorded-bearings" else on
    elif SOURCE not in fixed:
        tracker, bearings = _any(fixed, "tracker."), _any(fixed, "bearings.")
        if bearings or (words and not tracker):
            source = "bearings"
        elif tracker:
            source = "poses"
    for word in own:
        for prefix, kind in (("bearings.", "bearings"), ("tracker.", "poses")):
            if word.startswith(prefix) and source not in (kind, "both"):
                raise _unused(word, kind)
    if LAYOUT in fixed and BELIEVED_LAYOUT not in fixed:
        parameters.beacons.layout = parameters.bearings.layout
    if source == SWEEPS and name != "error_state":
        raise UsageError(f"{name} cannot use sweeps of base stations; error_state can")
    parameters.estimation.estimator = name
    if source != SWEEPS:
        parameters.estimation.source = source
    emulated = _emulated(recording, fixed, source, on)
    run = Run(
        label,
        name,
        parameters=parameters,
        source=source,
        emulated=emulated,
        fixed=frozenset({*fixed, *CHOICES}),
        begin_ns=None if words else flown.begin_ns,
    )
    _check_measurements(recording, run)
    return run


def _apply(parameters: FlightParameters, words: Sequence[str]) -> set[str]:
    """Apply the settings; return the names that were set."""
    for word in words:
        name = word.partition("=")[0]
        if not name.startswith(CHANGEABLE):
            raise UsageError(
                f"{word}: a replay changes estimation.*, bearings.*, tracker.* and "
                "beacons.layout; everything else was flown as it was"
            )
        if name in SHADOWS:
            raise UsageError(f"{word}: a replay has no shadow; give it its own --run")
    try:
        return set(parse_settings(parameters, words))
    except ParameterError as error:
        raise UsageError(str(error)) from None


def _estimator(words: list[str], parameters: FlightParameters, fixed: set[str]) -> str:
    chosen = parameters.estimation.estimator
    name = words[0] if words else chosen
    if name not in registry.names():
        raise UsageError(
            f"no estimator is called {name!r}: there are {', '.join(registry.names())}"
        )
    if ESTIMATOR in fixed and chosen != name:
        raise UsageError(
            f"{ESTIMATOR}={chosen} and the estimator {name} in one run: give each its own run"
        )
    return name


def _emulated(recording: Recording, fixed: set[str], source: str, on: On | None) -> frozenset[str]:
    changed = {name for name in fixed if name.startswith("bearings.")}
    if on == "recorded-bearings" and changed:
        raise UsageError(
            f"--on recorded-bearings with {min(changed)} changed: recorded bearings cannot be "
            "changed; use --on bearings, or leave --on out"
        )
    computed = set()
    if changed or on == "bearings" or (not recording.bearings and on != "recorded-bearings"):
        computed.add("bearings")
    if _any(fixed, "tracker."):
        computed.add("poses")
    return frozenset(kind for kind in computed if source in (kind, "both"))


def _check_measurements(recording: Recording, run: Run) -> None:
    for kind, found, instead in (
        ("poses", recording.poses, "--on bearings, or a setting tracker.NAME=VALUE"),
        ("bearings", recording.bearings, "--on bearings"),
        (SWEEPS, recording.sweeps, "no replay"),
    ):
        if run.uses(kind) and kind not in run.emulated and not found:
            raise LogFormatError(
                f"{recording.path} holds no {kind}; {instead} makes them from the truth"
            )


def _any(names: set[str], prefix: str) -> bool:
    return any(name.startswith(prefix) for name in names)


def _unused(word: str, kind: str) -> UsageError:
    source = "poses" if kind == "bearings" else "bearings"
    return UsageError(
        f"{word} changes {kind}, but only {source} are used; set {SOURCE}={kind} or both"
    )
