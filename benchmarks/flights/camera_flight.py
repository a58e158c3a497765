"""Hover and figure 8 on the poses that cameras measure in rendered pictures of tags.

A second of flight takes one to two seconds of processor time per camera, for drawing and reading.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from extensions.vision.simulated.outside_cameras import OutsideCameras

SECONDS, LAPS = 10.0, 2
RATE = 30.0, 30.0, 12.0  # Hz, of each size
STEPS = 5
"""Number of IMU periods between two checks of the flight."""
COVERED_AT = 25.0
"""Time, in s, at which a camera is covered: in the first lap."""
CAMERAS: dict[str, dict[str, float]] = {
    "one camera": {"number": 1},
    "two cameras": {"number": 2},
    "two, one covered half way": {"number": 2, "covered": 1, "covered_from": COVERED_AT},
}


def _flown(
    seed: int, estimator: str, cameras: dict[str, float], size: Size
) -> dict[str, float | str]:
    settings = {f"outside_cameras.{name}": value for name, value in cameras.items()}
    quiet = {"outside_cameras.exposure": 0.0, "outside_cameras.pictures": 0.0}
    quiet["outside_cameras.rate"] = size.of(*RATE)
    flight = WatchedFlight(seed, {"estimation.estimator": estimator, **quiet, **settings})
    camera = flight._poses
    assert isinstance(camera, OutsideCameras)
    flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
    flight.hover(1.0, size.of(1.5, 1.5, 0.2))
    hover = []
    end = flight.view().time + size.of(SECONDS, SECONDS, 0.2)
    while flight.view().time < end:
        hover.append(_off(flight))
    flight.start("follow_trajectory", trajectory="figure_eight", laps=LAPS)
    eight = []
    end = flight.view().time + size.of(math.inf, math.inf, 0.5)
    while (
        flight.view().time < end
        and flight.view().behavior == "follow_trajectory"
        and flight.view().armed
    ):
        eight.append(_off(flight))
    return {
        "hover, mm rms": _rms(hover),
        "figure 8, mm rms": _rms(eight),
        "poses, mm rms": _rms(camera.off),
        "pictures with a pose": len(camera.off) / camera.pictures,
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


def run(size: Size = Size.FULL) -> Report:
    """Fly with one camera and with two, both estimators and some seeds."""
    report = Report(
        "camera_flight",
        "Flight on cameras",
        [
            f"rendered 640 × 480 at {size.of(*RATE):g} Hz each, 56° wide, 40 ms late",
            "cameras 3.6 m from the middle, two at right angles, exposing in turn",
            "two tags of 12 cm, on top and at the back; no motion blur, no rolling shutter",
            f"whole stack in simulated time: {SECONDS:g} s of hover, {LAPS} laps of the figure 8",
        ],
    )
    for name, cameras in size.some(CAMERAS.items(), 2):
        for estimator in size.of(
            ("error_state", "complementary"), ("error_state",), ("error_state",)
        ):
            for seed in range(1, size.of(3, 1, 1) + 1):
                told = _flown(seed, estimator, cameras, size)
                report.rows.append(Row(f"{name}, {estimator}, seed {seed}", told))
                print(report.rows[-1], file=sys.stderr, flush=True)
    flown = [row.figures for row in report.rows if ", error_state" in row.method]
    worst = max(float(row["figure 8, mm rms"]) for row in flown)
    report.targets.append(Target("figure 8 with error_state, worst, mm rms", worst, 40.0))
    one, two = (
        np.mean([float(row.figures["poses, mm rms"]) for row in report.rows if name in row.method])
        for name in ("one camera", "two cameras")
    )
    report.targets.append(Target("poses of two cameras, of those of one", float(two / one), 1.0))
    return report
