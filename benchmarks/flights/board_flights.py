"""Fly the figure 8 on the real Betaflight in simulated time, in each way that it offers.

    python -m benchmarks board_flights [--quick]

Full sensors, steady laps, judged from the logs. The thrust curve is found by the experiment `mass`
on a vehicle that was weighed and whose motors are not the model's, and then flown.
"""

from __future__ import annotations

import statistics

from benchmarks.flights.experiment_flight import REST_TO_REST, fly
from benchmarks.harness import Report, Row, Size, Target
from extensions.betaflight import NAME as BETAFLIGHT
from extensions.betaflight.simulated.process import FIRMWARE
from quadrotor.parameter_description import ParameterValue

SEEDS, FEW = 12, 4
ANGLES: dict[str, ParameterValue] = {"board.level": "angles"}
OTHER_MOTORS: dict[str, ParameterValue] = {
    "simulator.thrust_efficiency": 0.93,
    "simulator.motor_offset": 4.0,
}
"""Motors with 20 % less thrust than the model's in hover, and another curve."""
SHORT: dict[str, ParameterValue] = {"experiment.duration": 6.0, "experiment.climb": 0.3}
"""Options of the experiment `mass` with which it takes less than half of its time."""
MASS = 1.308
"""kg, on the scales."""


def run(size: Size = Size.FULL) -> Report:
    few, many = (range(1, count + 1) for count in size.of((FEW, SEEDS), (1, 2), (1, 1)))
    report = Report(
        "board_flights",
        "Betaflight",
        ["real firmware in simulated time, full sensors; position rms, median / worst of seeds"],
    )
    if not FIRMWARE.exists():
        report.notes.append("no Betaflight: scripts/betaflight builds it")
        return report
    lap: dict[str, ParameterValue] = size.of({}, {}, REST_TO_REST)
    judge(report, "figure 8, body rates", "figure_eight", lap, many, 25.0)
    if size is not Size.SMOKE:  # each flight takes seconds
        judge(report, "figure 8, mode ANGLE", "figure_eight", ANGLES, few, 50.0)
        judge(report, "figure 8 on bearings", "bearings", {}, few, 40.0)
        judge(report, "other motors, not identified", "figure_eight", OTHER_MOTORS, few[:1])
    found = identified(report, size)
    if size is not Size.SMOKE:
        judge(report, "other motors, identified", "figure_eight", OTHER_MOTORS | found, many, 25.0)
    return report


def judge(
    report: Report,
    what: str,
    experiment: str,
    settings: dict[str, ParameterValue],
    seeds: range,
    limit: float | None = None,
) -> None:
    """Fly an experiment with these seeds; the worst has to meet the limit (mm)."""
    flown = [fly(experiment, settings, seed=k, board=BETAFLIGHT).result.metrics for k in seeds]
    off = [1e3 * one["position_rms_m"] for one in flown]
    both = f"{statistics.median(off):.1f} / {max(off):.1f}"
    report.rows.append(Row(what, {"seeds": len(off), "found": both, "unit": "mm"}))
    if limit is not None:
        report.targets.append(Target(f"{what}: position, mm rms", max(off), limit))


def identified(report: Report, size: Size) -> dict[str, ParameterValue]:
    """Return mass and motor law that the experiment finds; report the error of the thrust."""
    weighed: dict[str, ParameterValue] = {"experiment.weighed": MASS, **size.of({}, {}, SHORT)}
    flown = fly("mass", OTHER_MOTORS | weighed, board=BETAFLIGHT)
    assert flown.proposal is not None
    error = 100.0 * flown.result.metrics["thrust_error_share"]
    report.rows.append(Row("thrust in the range flown", {"found": f"{error:.2f}", "unit": "% off"}))
    report.targets.append(Target("thrust in the range flown: error, %", error, 2.0))
    return flown.proposal.values
