"""The choice of estimators and their sources by the parameters, and whether a hand-over is
allowed now.

On the ground a choice acts at once. In flight the vehicle changes only to an estimator that has
received the same measurements, has converged and agrees with the one in use: the shadow, or the
reserve on the tracker's poses. Everything else is refused and changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from estimation import registry
from estimation.estimator import Estimator
from estimation.names import NONE
from estimation.parameters import EstimationParameters
from quadrotor.errors import RefusedError, UsageError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from vehicle.estimators.estimator_runner import BEARINGS, BOTH, POSES, Runner
from vehicle.estimators.readiness import Lack, readiness

ESTIMATOR, SHADOW, SOURCE = "estimation.estimator", "estimation.shadow", "estimation.source"
SHADOW_SOURCE = "estimation.shadow_source"
RESCUE, BUILT_IN = "estimation.rescue", "estimation.plugin.built_in"
SAME = "same"


@dataclass(frozen=True, slots=True)
class Choice:
    """The four parameters, with the shadow's source resolved, and its name when it is there for a
    rescue only.
    """

    name: str
    source: str
    shadow: str
    shadow_source: str

    @classmethod
    def of(
        cls, name: str, source: str, shadow: str, shadow_source: str, rescue: bool = False
    ) -> Choice:
        if rescue and shadow == NONE and (name, source) == ("error_state", POSES):
            shadow, shadow_source = "complementary", SAME
        return cls(name, source, shadow, source if shadow_source == SAME else shadow_source)


@dataclass(frozen=True, slots=True)
class Change:
    """A change of the estimator or its source that the vehicle makes by itself.

    Attributes:
        why: the reason, for the log. level: the level of that line.
        values: parameters to apply; empty when there is no tracker to go back to: the vehicle
        lands.
    """

    why: str
    level: int
    values: Mapping[str, ParameterValue]


@dataclass(slots=True)
class EstimatorSet:
    """The running estimators: `active` is in use, `shadow` runs in parallel, `reserve` runs on
    poses as a fallback.
    """

    active: Runner
    shadow: Runner | None = None
    reserve: Runner | None = None

    def in_parallel(self) -> tuple[Runner, ...]:
        return tuple(one for one in (self.shadow, self.reserve) if one is not None)

    def all(self) -> tuple[Runner, ...]:
        return (self.active, *self.in_parallel())

    def everything(self) -> list[Estimator]:
        """Return all estimators, the one in use first, and those beneath plugins."""
        beneath = [one.built_in for one in self.all() if one.built_in is not None]
        return [one.estimator for one in (*self.all(), *beneath)]

    @property
    def reserve_ready(self) -> bool:
        """Return whether an estimate from fresh poses is available as a fallback."""
        return self.reserve is not None and self.reserve.estimator.converged

    def fallen_back(self) -> dict[str, ParameterValue]:
        """Return the parameters after falling back to the reserve, which must be ready."""
        assert self.reserve is not None
        return {
            SOURCE: POSES,
            ESTIMATOR: self.reserve.name,
            SHADOW: self.active.name,
            SHADOW_SOURCE: self.active.source,
        }

    def rearranged(self, choice: Choice, make: Callable[[str, str], Runner]) -> EstimatorSet:
        """Return the estimators of a choice; estimators without a place in it are dropped.

        Args:
            make: makes an estimator of this name on this source.
        """
        there, active = list(self.in_parallel()), self.active
        built_in = active.built_in
        if built_in is not None and built_in.is_(choice.name, choice.source):
            active = built_in
        elif not active.is_(choice.name, choice.source):
            successor = next((one for one in there if one.is_(choice.name, choice.source)), None)
            if successor is not None:
                there.append(active)
                active = successor
            elif active.name == choice.name:
                active.feed(choice.source)
            else:
                active = make(choice.name, choice.source)
            there = [one for one in there if one is not active]
        shadow = reserve = None
        if choice.shadow != NONE:
            name, source = choice.shadow, choice.shadow_source
            shadow = next((one for one in there if one.is_(name, source)), None)
            shadow = shadow or make(name, source)
        if choice.source != POSES:
            poses = [one for one in there if one.source == POSES and one is not shadow]
            reserve = poses[-1] if poses else make((active.built_in or active).name, POSES)
            reserve = reserve.built_in or reserve
        return EstimatorSet(active, shadow, reserve)


def check(
    estimators: EstimatorSet,
    parameters: EstimationParameters,
    values: Mapping[str, ParameterValue],
    state: Record,
    armed: bool,
) -> dict[str, ParameterValue]:
    """Return the parameters that a change implies; on the ground, compile what it needs.

    Args:
        parameters: the present ones. values: the changes, which may include others.
        state: STATE (1,) in use.

    Raises RefusedError with the reason and its numbers.
    """
    present: dict[str, ParameterValue] = {
        ESTIMATOR: parameters.estimator,
        SHADOW: parameters.shadow,
        SOURCE: parameters.source,
        SHADOW_SOURCE: parameters.shadow_source,
        RESCUE: parameters.rescue,
        BUILT_IN: parameters.plugin.built_in,
    }
    if not values.keys() & present.keys():
        return {}
    wanted = {name: str(values.get(name, present[name])) for name in present}
    extra: dict[str, ParameterValue] = {}
    active = estimators.active
    for one in estimators.all():
        if one.built_in is not None and one.built_in.name != wanted[BUILT_IN]:
            raise RefusedError(
                f"{BUILT_IN} stays {one.built_in.name} while {one.name} runs on it; "
                "choose another estimator first"
            )
    back = wanted[SOURCE] == POSES != active.source
    if armed and back and estimators.reserve is not None and ESTIMATOR not in values:
        extra[ESTIMATOR] = wanted[ESTIMATOR] = estimators.reserve.name
    moves = not active.is_(wanted[ESTIMATOR], wanted[SOURCE])
    in_place = active.name == wanted[ESTIMATOR] and wanted[SOURCE] == BOTH
    if armed and moves and not in_place:
        successor = _successor(estimators, wanted)
        ready = readiness(successor, active, state)
        if ready.lack is not Lack.NOTHING:
            raise RefusedError(ready.reason)
        if SHADOW not in values and successor is not active.built_in:
            # The previous one stays as the shadow; on poses it is the reserve anyway.
            extra[SHADOW] = wanted[SHADOW] = _left(active, wanted)
            if wanted[SHADOW] != NONE and wanted[SOURCE] != active.source:
                extra[SHADOW_SOURCE] = wanted[SHADOW_SOURCE] = active.source
    choice = _choice(wanted)
    if choice.shadow == choice.name and choice.shadow_source == choice.source:
        if SHADOW in values or not moves:
            raise RefusedError(
                f"{SHADOW} = {choice.shadow} on {choice.source} is already in use; "
                f"choose another, or {NONE}"
            )
        extra[SHADOW] = wanted[SHADOW] = NONE
    _compile(estimators, _choice(wanted), wanted[BUILT_IN], armed)
    return extra


def _choice(wanted: Mapping[str, str]) -> Choice:
    rescue = wanted[RESCUE] == str(True)
    return Choice.of(
        wanted[ESTIMATOR], wanted[SOURCE], wanted[SHADOW], wanted[SHADOW_SOURCE], rescue
    )


def _left(active: Runner, wanted: Mapping[str, str]) -> str:
    """Return the shadow's name after a change in flight."""
    if active.source == wanted[SOURCE]:
        return active.name
    return NONE if active.source == POSES else active.name


def _successor(estimators: EstimatorSet, wanted: Mapping[str, str]) -> Runner:
    """Return the estimator that takes over in flight. Raises RefusedError when no running one
    can.
    """
    name, source = wanted[ESTIMATOR], wanted[SOURCE]
    for one in (estimators.active.built_in, *estimators.in_parallel()):
        if one is not None and one.is_(name, source):
            return one
    running = ", ".join(str(one) for one in estimators.in_parallel()) or NONE
    raise RefusedError(
        f"{name} on {source} does not run yet (running: {running}): run it in parallel first "
        f"({SHADOW} = {name}, {SHADOW_SOURCE} = {source})"
    )


def _compile(estimators: EstimatorSet, choice: Choice, built_in: str, armed: bool) -> None:
    running = {(one.name, one.source != POSES) for one in estimators.all()}
    running |= {
        (one.built_in.name, one.source != POSES) for one in estimators.all() if one.built_in
    }
    asked = [(choice.name, choice.source != POSES)]
    if estimators.active.plugged and choice.name == estimators.active.name:
        asked.clear()  # of unknown make: nothing to compile
    if choice.shadow != NONE:
        asked.append((choice.shadow, choice.shadow_source != POSES))
    if choice.source != POSES:
        asked.append((choice.name, False))
    for name, bearings in asked:
        if (name, bearings) in running or (name, True) in running:
            continue
        if name not in registry.names():
            if armed:
                raise RefusedError(f"estimator {name} is started on the ground: disarm first")
            _prepare(built_in, bearings)
            continue
        if not registry.ready(name, bearings):
            if armed:
                raise RefusedError(
                    f"estimator {name} is not compiled for these measurements, which takes "
                    "seconds; disarm, or choose it before arming"
                )
            _prepare(name, bearings)


def _prepare(name: str, bearings: bool) -> None:
    """Prepare an estimator. Raises RefusedError if an extension's cannot run."""
    try:
        registry.prepare(name, bearings)
    except UsageError as error:
        raise RefusedError(str(error)) from error


def hands_over(active_source: str, values: Mapping[str, ParameterValue]) -> bool:
    """Return whether a change moves the vehicle from the tracker to another source."""
    return active_source != BEARINGS and values.get(SOURCE) == BEARINGS
