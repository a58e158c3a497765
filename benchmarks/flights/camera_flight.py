"""Hover and figure 8 on the poses that a camera measures in rendered pictures of tags."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bearing_sim.rendered_camera import Pattern, RenderedCamera
from bearing_sim.sampling import DelayLine, SampleGrid
from bearing_sim.tracker import PoseMeasurement, TrackerParameters
from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Target
from estimation.tags.detector import TagDetector
from estimation.tags.intrinsics import Intrinsics
from estimation.tags.tag_layout import CameraPlace, TagLayout, TagPlace
from estimation.tags.tag_tracker import TagTracker
from quadrotor.errors import MeasurementError
from quadrotor.records import Array
from quadrotor.rotations import quaternion_from_euler, quaternion_to_matrix

RATE, LATE_NS = 30.0, 40_000_000
SECONDS, LAPS = 10.0, 2
STEPS = 5
"""Number of IMU periods between two checks of the flight."""
CAMERA = RenderedCamera(
    640,
    480,
    np.array([[600.0, 0.0, 322.0], [0.0, 602.0, 238.0], [0.0, 0.0, 1.0]]),
    np.array([-0.2, 0.05, 0.001, -0.001, 0.0]),
)
LENS = Intrinsics(CAMERA.width, CAMERA.height, CAMERA.matrix, CAMERA.distortion)
STAND = CameraPlace(position=(-3.2, 0.0, 2.6), looks_at=(0.0, 0.0, 1.0))
LAYOUT = TagLayout(
    bodies={
        "quad1": {
            3: TagPlace(size=0.12, position=(0.0, 0.0, 0.03)),
            4: TagPlace(size=0.12, position=(-0.12, 0.0, -0.08), turn=(90.0, 0.0, -90.0)),
        }
    },
    camera=STAND,
)


class CameraTracker:
    """Replacement of `bearing_sim.tracker.SimulatedTracker`."""

    def __init__(self, seed: int) -> None:
        self.parameters = TrackerParameters()
        self.pictures, self.off = 0, [0.0]
        self._tags, self._camera = TagTracker(LAYOUT, LENS), replace(CAMERA)
        self._detector = TagDetector(LENS)
        self._grid, self._random = SampleGrid(), np.random.default_rng(seed)
        self._line: DelayLine[PoseMeasurement] = DelayLine()

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        if not self._grid.takes(stamp_ns, RATE):
            return
        self.pictures += 1
        patterns = self._patterns(position_w, quaternion_to_matrix(quaternion_wb))
        try:
            found = self._tags.take(self._camera.take(patterns, self._random))["quad1"]
        except (MeasurementError, KeyError):  # wrong or hidden: no pose, as in a flight
            return
        self.off.append(float(np.sum((found[0] - position_w) ** 2)))
        self._line.put(stamp_ns + LATE_NS, PoseMeasurement(stamp_ns, *found))

    def due(self, now_ns: int) -> list[PoseMeasurement]:
        return self._line.due(now_ns)

    @property
    def next_ns(self) -> int | None:
        return self._line.next_ns

    def _patterns(self, position_w: Array, R_wb: Array) -> list[Pattern]:
        to_camera, patterns = STAND.axes_w.T, []
        for number, one in LAYOUT.bodies["quad1"].items():
            R_wt = R_wb @ quaternion_to_matrix(quaternion_from_euler(*np.radians(one.turn)))
            at = position_w + R_wb @ np.array(one.position) - np.array(STAND.position)
            picture = self._detector.picture(number)
            wide = one.size * len(picture) / (len(picture) - 2)
            patterns.append(Pattern(picture, (wide, wide), to_camera @ at, to_camera @ R_wt))
        return patterns


def _flown(seed: int, estimator: str) -> dict[str, float | str]:
    flight = WatchedFlight(seed, {"estimation.estimator": estimator})
    camera = CameraTracker(seed)
    flight._tracker = camera  # type: ignore[assignment]
    flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
    flight.hover(1.0, 1.5)
    hover = []
    end = flight.view().time + SECONDS
    while flight.view().time < end:
        hover.append(_off(flight))
    flight.start("follow_trajectory", trajectory="figure_eight", laps=LAPS)
    eight = []
    while flight.view().behavior == "follow_trajectory" and flight.view().armed:
        eight.append(_off(flight))
    return {
        "hover, mm rms": _rms(hover),
        "figure 8, mm rms": _rms(eight),
        "camera, mm rms": _rms(camera.off[1:]),
        "pictures with a pose": len(camera.off[1:]) / camera.pictures,
        "ended": flight.view().mode,
    }


def _off(flight: WatchedFlight) -> float:
    """Continue the flight and return the squared distance from the reference, m^2."""
    for _ in range(STEPS):
        flight.advance()
    off = flight.robot.truth["position_w"][0] - flight.stack.reference["position_w"][0]
    return float(off @ off)


def _rms(squares: list[float]) -> float:
    return 1e3 * float(np.sqrt(np.mean(squares)))


def run(quick: bool = False) -> Report:
    """Fly both estimators with some seeds."""
    report = Report(
        "camera_flight",
        "Flight on a camera",
        [
            "rendered 640 × 480 at 30 Hz, 56° wide, 40 ms late; camera 3.6 m from the middle",
            "two tags of 12 cm, on top and at the back; no motion blur, no rolling shutter",
            f"whole stack in simulated time: {SECONDS:g} s of hover, {LAPS} laps of the figure 8",
        ],
    )
    for estimator in ("error_state", "complementary"):
        for seed in range(1, 2 if quick else 4):
            report.rows.append(Row(f"{estimator}, seed {seed}", _flown(seed, estimator)))
    worst = max(
        float(row.figures["figure 8, mm rms"])
        for row in report.rows
        if row.method.startswith("error_state")
    )
    report.targets.append(Target("figure 8 with error_state, worst seed, mm rms", worst, 40.0))
    return report
