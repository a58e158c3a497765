"""All detectors over one run, and the order of what they find."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from math import log2

from console.evaluation.findings import Finding, Parameters, Spans, Topics
from extensions.explanation import (
    battery,
    bearings,
    causes,
    consequences,
    instruments,
    motion,
    repetitions,
    scatter,
    sightings,
    tracker,
    transients,
)
from extensions.explanation.blocks import airborne

DETECTORS: tuple[Callable[[Topics, Parameters, Spans], Iterator[Finding]], ...] = (
    instruments.instruments,
    repetitions.tracker_frozen,
    repetitions.imu_stuck,
    repetitions.imu_gaps,
    repetitions.ended_in_flight,
    repetitions.barometer_stuck,
    repetitions.barometer_off,
    repetitions.battery_stuck,
    tracker.tracker_stamped_wrong,
    tracker.tracker_slow,
    tracker.tracker_moved,
    motion.motion,
    motion.centre,
    transients.transients,
    causes.weak_motor,
    causes.vibration,
    causes.tracker_late,
    causes.tracker_gaps,
    causes.tracker_outliers,
    scatter.tracker_noisy,
    sightings.sightings,
    bearings.beacon_off,
    bearings.bearings_disagree,
    bearings.fell_back,
    causes.link_lost,
    battery.battery_sag,
    battery.battery_drop,
    consequences.oscillating,
    consequences.off_reference,
    consequences.saturation,
    consequences.inconsistent,
    consequences.tilted,
    consequences.at_bound,
)


_CONTRADICTED = ("tracker_contradicted", "inertial_suspect")
_JUDGED_ON_BOARD = (*_CONTRADICTED, "tracker_tilted")
_OF_THE_IMU = ("gyroscope_off", "accelerometer_off")
_OF_THE_POSES = ("tracker_outliers", "tracker_moved", "tracker_scale", "tracker_stamps")
_OF_BEARINGS = ("fell_back", "bearings_disagree", *_OF_THE_POSES)
_SEEN = ("bearings_swapped", "bearings_distorted", "bearings_scattered")
_SEEN_APART = ("tracker_against_bearings", *_SEEN)
_OF_FORCES = ("thrust_off", "outside_force", "drag_off")
_MISFELT = ("outside_torque", "outside_force", "thrust_off")
CONSEQUENCES: Mapping[str, tuple[str, ...]] = {
    "tracker_clock": ("tracker_gaps", "tracker_late", *_OF_THE_POSES, *_JUDGED_ON_BOARD),
    "tracker_frozen": (*_OF_THE_POSES, *_JUDGED_ON_BOARD, *_SEEN_APART, *_OF_THE_IMU),
    "imu_stuck": (*_OF_THE_POSES, *_JUDGED_ON_BOARD, *_OF_THE_IMU, *_MISFELT),
    "imu_clipped": (*_OF_THE_POSES, *_JUDGED_ON_BOARD, *_OF_THE_IMU, *_MISFELT),
    "imu_gaps": ("tracker_late", *_MISFELT),
    "accelerometer_off": (*_JUDGED_ON_BOARD, "tracker_scale", "tracker_stamps", "gyroscope_off"),
    "tracker_moved": (*_SEEN_APART, *_OF_THE_IMU, "tracker_outliers", "tracker_tilted"),
    "tracker_tilted": (*_SEEN_APART, *_CONTRADICTED, "tracker_outliers", "tracker_stamps"),
    "tracker_contradicted": _SEEN_APART,
    "tracker_scale": (*_SEEN_APART, "tracker_stamps"),
    "gyroscope_off": (*_CONTRADICTED, "outside_torque"),
    "bearings_swapped": (*_OF_BEARINGS, "beacon_off"),
    "bearings_distorted": (*_OF_BEARINGS, "beacon_off"),
    "beacon_off": _OF_BEARINGS,
    "tracker_outliers": (*_SEEN_APART, "tracker_noisy"),
    "tracker_noisy": (*_SEEN_APART, *_CONTRADICTED, "tracker_scale", "tracker_stamps"),
    "bearings_scattered": _OF_BEARINGS,
    "motor_weak": ("centre_off", "motor_strong", "outside_torque", *_OF_FORCES),
    "motor_strong": ("centre_off", "outside_torque", *_OF_FORCES),
    "centre_off": ("outside_torque",),
    "vibration": ("outside_torque", "inertial_suspect", "tracker_scale", "tracker_stamps"),
    "outside_force": ("drag_off",),
}
"""Kinds of finding that another one can bring about: those come after it, not beside it."""
_JUMPED = "tracker_jumped"
"""Kind that any other finding about the tracker brings about."""


def explain(topics: Topics, parameters: Parameters) -> list[Finding]:
    """Return the events of a run, heaviest first, consequences after causes.

    Of each kind it is the heaviest, of those that show their evidence if there are any. A detector
    ignores a run without the topics that it needs.
    """
    topics = {name: one for name, one in topics.items() if len(one)}
    spans = airborne(topics)
    found: dict[str, Finding] = {}
    for one in (one for detector in DETECTORS for one in detector(topics, parameters, spans)):
        known = found.get(one.kind)
        if known is None:
            found[one.kind] = one
        elif one.signals and not known.signals:  # what the vehicle told, with its figure
            found[one.kind] = replace(one, weight=max(one.weight, known.weight))
        elif one.weight > known.weight and bool(one.signals) >= bool(known.signals):
            found[one.kind] = one
    for cause, kinds in CONSEQUENCES.items():
        if cause in found and not found[cause].follows:
            found |= {k: replace(found[k], follows=True) for k in kinds if k in found}
    if _JUMPED in found and any(k.startswith("tracker_") for k in found if k != _JUMPED):
        found[_JUMPED] = replace(found[_JUMPED], follows=True)
    return sorted(_with_confidence(found.values()), key=lambda one: (one.follows, -one.weight))


def _with_confidence(found: Iterable[Finding]) -> Iterator[Finding]:
    """Yield the findings, the causes with their share of the evidence for any cause."""
    evidence = {one.kind: log2(1.0 + one.weight) for one in found if not one.follows}
    for one in found:
        share = evidence.get(one.kind, 0.0) / max(sum(evidence.values()), 1e-9)
        yield replace(one, confidence=share)
