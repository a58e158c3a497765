"""Flights with each fault of the simulated laboratory: which causes the explanation names.

    python -m benchmarks diagnosis

Simulated time: real stack, simulated firmware and plant, full sensors. A fault of the library
(docs/how_to/faults.md), or a parameter that is moved like one, comes on in flight and stays; the
log is explained as for a report. Limits were chosen with seeds from 501 on.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from benchmarks.explanation.explanations import NONE, WORLDS, FaultyFlight, take_off
from benchmarks.harness import Report, Row, Size, Target
from console.evaluation.findings import Finding, explain_log
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import RefusedError
from quadrotor.parameters import ParameterStore
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

CONDITIONS = (("clean", "figure 8"), ("rough", "hover"), ("rough", "figure 8"), ("clean", "hover"))
"""World and manoeuvre."""
FIRST_SEED = 2501
HEALTHY = 15
"""Flights without a fault in each condition."""
SURE = 0.8
"""Confidence from which on a cause should be the right one."""
BEGINS, WATCHED = 4.0, 16.0
"""Time in s from the hover to the fault, and to the landing."""
AIR, MOVING = "rough", "figure 8"


@dataclass(frozen=True)
class Fault:
    """A fault, with the kinds of finding that name it, and where it can show at all.

    Attributes:
        text: as in docs/how_to/faults.md, without its schedule.
        kinds: of findings.
        only: a word of the condition; elsewhere the fault does not touch the flight.
        schedule: of the fault.
    """

    text: str
    kinds: tuple[str, ...]
    only: str = ""
    schedule: str = f"from={BEGINS:g}"

    @property
    def home(self) -> str:
        """Return the parameter that takes it."""
        part = self.text.partition(".")[0]
        return f"{part if part in ('tracker', 'bearings') else 'simulator'}.faults"


_IMU = ("accelerometer_off", "inertial_suspect")
_MOVED = ("tracker_moved", "tracker_against_bearings", "tracker_contradicted")
FAULTS = (
    Fault("tracker.freeze", ("tracker_frozen",)),
    Fault("tracker.freeze what=position", ("tracker_frozen",)),
    Fault("tracker.freeze what=attitude", ("tracker_frozen",)),
    Fault("tracker.drift x=0.05", ("tracker_against_bearings",)),
    Fault("tracker.tilt x=3", ("tracker_tilted", "tracker_contradicted"), schedule="from=4 ramp=1"),
    Fault("tracker.scale factor=1.08", ("tracker_scale", "tracker_against_bearings")),
    Fault("tracker.handedness", ("tracker_contradicted",)),
    Fault("tracker.axes which=world_quarter", _MOVED, MOVING),
    Fault("tracker.swapped_bodies", ("tracker_moved",)),
    Fault("tracker.clock step=0.04", ("tracker_clock",)),
    Fault("tracker.clock step=-0.04", ("tracker_late", "tracker_stamps")),
    Fault("tracker.clock drift=5000", ("tracker_clock",)),
    Fault("tracker.delay value=0.1", ("tracker_late",), schedule="from=4 ramp=5"),
    Fault("tracker.duplicates", ("tracker_repeated",)),
    Fault("tracker.order", ("tracker_disordered",)),
    Fault("tracker.drop_out value=1", ("tracker_gaps",), schedule="from=4 every=3 for=0.6"),
    Fault("tracker.outliers value=0.1", ("tracker_outliers",)),
    Fault("tracker.rate value=15", ("tracker_slow",)),
    Fault("imu.scale factor=1.1", _IMU),
    Fault("imu.misalignment x=4", _IMU),
    Fault("imu.accelerometer_ramp z=0.1", _IMU),
    Fault("imu.gyroscope_ramp x=0.3", ("gyroscope_off",)),
    Fault("imu.scale sensor=gyroscope axis=x factor=1.3", ("gyroscope_off",), MOVING),
    Fault("imu.clip accelerometer=11 gyroscope=20", ("imu_clipped", "imu_stuck"), MOVING),
    Fault("imu.stuck", ("imu_stuck",)),
    Fault("imu.gaps", ("imu_gaps",), schedule="from=4 share=0.1 spell=0.03"),
    Fault("barometer.ramp rate=10", ("barometer_off",)),
    Fault("barometer.step pressure=40", ("barometer_off",)),
    Fault("barometer.stuck", ("barometer_stuck",)),
    Fault("battery.stuck", ("battery_stuck",)),
    Fault("battery.sag resistance=0.15", ("battery_sag",)),
    Fault("motors.fade motor=left gain=0.85", ("motor_weak",), schedule="from=4 ramp=2"),
    Fault("motors.flicker gain=0.6 rate=8", ("motor_weak",)),
    Fault("motors.imbalance motor=rear vibration=4", ("vibration",)),
    Fault("simulator.vibration value=5", ("vibration",)),
    Fault("vehicle.centre x=0.02", ("centre_off",)),
    Fault("vehicle.slung_load mass=0.15", ("thrust_off",)),
    Fault("simulator.payload value=0.25", ("thrust_off",)),
    Fault("simulator.wind_x value=4", ("outside_force",), AIR, "from=4 ramp=1"),
    Fault("simulator.gust value=3", ("outside_force", "drag_off"), AIR),
    Fault("world.updraught speed=3 radius=1.5", ("thrust_off",), AIR),
    Fault("world.wall axis=x at=1.2 force=3 reach=0.4", ("outside_force",), MOVING),
    Fault("bearings.delay value=0.06", ("tracker_late",)),
    Fault("bearings.moving_beacon x=0.1", ("beacon_off",)),
    Fault("bearings.swapped_identities", ("bearings_swapped",)),
    Fault("bearings.correlated_noise sigma=3", ("bearings_scattered",)),
    Fault("bearings.lens k=0.15", ("bearings_distorted",)),
)


def run(size: Size = Size.FULL) -> Report:
    """Return which causes are named for each fault, and for flights without one."""
    conditions = CONDITIONS[: size.of(4, 2, 1)]
    report = Report(
        "diagnosis",
        "Which causes the explanation names",
        [
            f"simulated time, each fault in {len(conditions)} conditions: clean or rough world, "
            "hover or figure 8, one seed each; faults that cannot show in a condition are left out",
            f"the fault comes on {BEGINS:g} s after the take-off and stays until the vehicle has "
            "landed, by itself or as planned; faults of the bearings are flown on bearings",
        ],
    )
    right, first_right, total = 0, 0, 0
    sure, sure_right = 0, 0
    for number, fault in enumerate(size.some(FAULTS, 2)):
        named, hits = Counter[str](), 0
        flown = [k for k, c in enumerate(conditions) if not fault.only or fault.only in c]
        for k in flown:
            found = fly(fault, FIRST_SEED + 10 * number + k, *conditions[k])
            causes = [one.kind for one in found[:2]]
            hits += any(kind in fault.kinds for kind in causes)
            is_right = bool(causes) and causes[0] in fault.kinds
            first_right += is_right
            if found and found[0].confidence >= SURE:
                sure, sure_right = sure + 1, sure_right + is_right
            named[", ".join(causes) or NONE] += 1
        right, total = right + hits, total + len(flown)
        told = "; ".join(f"{kinds} {count}" for kinds, count in named.most_common())
        report.rows.append(
            Row(fault.text, {"flights": len(flown), "right": hits, "named first": told})
        )
    healthy, claimed = Counter[str](), 0
    for k, condition in enumerate(conditions):
        for n in range(size.of(HEALTHY, 2, 1)):
            found = fly(None, FIRST_SEED + 1000 + 10 * n + k, *condition)
            healthy[found[0].kind if found else NONE] += 1
            claimed += bool(found)
    told = ", ".join(f"{kind} {count}" for kind, count in healthy.most_common())
    right_of_them = healthy[NONE]
    report.rows.append(
        Row("no fault", {"flights": healthy.total(), "right": right_of_them, "named first": told})
    )
    report.targets += [
        Target("fault named first or second, share", right / total, 0.85, at_most=False),
        Target(
            "flights without a fault in which nothing is named, share",
            right_of_them / healthy.total(),
            0.95,
            at_most=False,
        ),
    ]
    report.notes.append(f"named first: {first_right} of {total}")
    report.notes.append(f"named first with confidence {SURE:g} or more: {sure_right} of {sure}")
    return report


def fly(fault: Fault | None, seed: int, world: str, manoeuvre: str) -> list[Finding]:
    """Fly with a fault, or without, and return the explanation of the log."""
    parameters = FlightParameters().model_copy(deep=True)
    parameters.seed(seed)
    on_bearings = fault is not None and fault.home.startswith("bearings")
    settings = dict(WORLDS[world])
    if on_bearings:
        settings |= {"estimation.shadow": "error_state", "estimation.shadow_source": "bearings"}
    store = ParameterStore(parameters)
    store.preset(settings)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.mcap"
        log = FlightLog(path, "quad1", store, {"run_id": "flight"})
        flight = FaultyFlight(parameters, SimulatedVehicle(parameters.simulator), log)
        try:
            with suppress(RefusedError):  # it landed by itself
                take_off(flight, manoeuvre, on_bearings=on_bearings)
                if fault is not None:
                    flight.change({fault.home: f"{fault.text} {fault.schedule}"})
                flight.wait(WATCHED)
                flight.start("land")
                flight.wait_until(lambda v: not v.armed, what="landed", timeout=30.0)
                flight.wait(1.0)
        finally:
            log.close()
        return explain_log(path)
