"""Simulate flights on a tracker that lies, or does not, and look how soon its lies are noticed.

    python -m benchmarks tracker_integrity [--quick]
    python -m benchmarks.onboard.tracker_integrity [--hours 10]

Compiled flights of plant, sensors, filter and laws, each from the floor and back: rest, take-off,
hover, three laps of the 8, hover, landing. There are three worlds: `clean` and `rough` with the
simulator's preset of that name and its default tracker, and `varied`, rough, with a tracker whose
rate, delay, noise and errors of axes, scale and stamps are drawn for each flight, all within what
is no lie. The vehicle reacts to nothing there. With the whole stack it takes off on each lie.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from benchmarks.onboard.tracker_lies import LIES, LYING_TRACKER, UNDER_WAY, lie, observe
from control.behaviors.parameters import BehaviorParameters
from control.geometric_law import step_one
from control.parameters import ControlParameters
from control.trajectories.figure_eight import FigureEight, figure_eight_at
from control.trajectories.lift_off_probe import BEGINS as PROBE_BEGINS
from control.trajectories.lift_off_probe import add_probe_at
from estimation.complementary_filter import correct_one, predict_one
from estimation.parameters import EstimationParameters
from estimation.tracker_integrity.comparison import compare_pose
from estimation.tracker_integrity.evidence import ALARM, strongest
from estimation.tracker_integrity.felt import note_sample
from estimation.tracker_integrity.memory import INTEGRITY_MEMORY, new_integrity
from estimation.tracker_integrity.slopes import errors
from extensions.batches.noise import normals, seeded
from extensions.batches.onboard import ONBOARD, SETTINGS, new_onboard, new_settings
from quadrotor.compiled import compiled
from quadrotor.records import POSE_SAMPLE, Record
from vehicle.boards.reference_rounding import _round as whole_references
from vehicle.safety.parameters import SafetyParameters
from vehicle.simulator.air import blow
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.plant import PLANT, advance, new_plant
from vehicle.simulator.presets import preset_values
from vehicle.simulator.sensors import (
    ACCELEROMETER_SCALE,
    CHANNELS,
    GUSTS,
    GYROSCOPE_SCALE,
    SENSORS,
    WARM_UP_TIME,
    ZERO,
    new_sensors,
    sample,
)
from vehicle_link.serial.ids import PRESSURE_OFFSET, Id

PERIOD_NS = 2_000_000
STILL, REST, CLIMB, HOVER, EIGHT, SINK, AFTER = 1.0, 3.0, 4.0, 6.0, 27.0, 5.0, 2.0
"""Durations, in s: the gyroscope's calibration, rest, and the parts of a flight."""
HEIGHT, BELOW = 1.0, 0.05
"""Height of hover and depth of the landing's end, in m."""
_SHARES = np.linspace(0.0, 0.5, 5001)
PROBED = REST + CLIMB * float(
    np.interp(
        PROBE_BEGINS / HEIGHT, _SHARES**3 * (10.0 - 15.0 * _SHARES + 6.0 * _SHARES**2), _SHARES
    )
)
"""Time, in s, at which the reference climbs through the height of the probe."""
PROBE = math.radians(BehaviorParameters().take_off_probe)
SECONDS = REST + CLIMB + HOVER + EIGHT + HOVER + SINK + AFTER
ON_GROUND, IN_HOVER, IN_EIGHT = 0.0, REST + CLIMB + 0.5 * HOVER, REST + CLIMB + HOVER + 8.0
"""Times, in s, at which a tracker begins to lie."""
BEGINS = {"from the start": ON_GROUND, "in hover": IN_HOVER, "in the 8": IN_EIGHT}
VERTICAL, STAMPS, SCALE = range(3)
TOLD = {8: VERTICAL, 9: VERTICAL, 10: VERTICAL, 11: SCALE, 12: STAMPS, 13: STAMPS}
"""Flags of the lies that give no alarm, by their numbers."""
GIVEN_UP = 30.0
"""Time, in s, after which a lie is not noticed."""
WORLDS = ("clean", "rough", "varied")
SHARE = 0.2
"""Hours in the other worlds over those in the clean one."""
ALLOWED = {"clean": 0.01, "rough": 0.1}
"""False alarms an hour to stay below, lines in the log included."""
_ACCELEROMETER, _GYROSCOPE = int(Id.ACCELEROMETER_X), int(Id.GYROSCOPE_X)
_PRESSURE = int(Id.PRESSURE)

FLIGHT = np.dtype(
    [
        ("settings", SETTINGS),
        ("sensors", SENSORS),
        ("plant", PLANT),
        ("onboard", ONBOARD),
        ("tracker", LYING_TRACKER),
        ("integrity", INTEGRITY_MEMORY),
        ("random", "u8", 4),
        ("gyroscope_bias_b", "f8", 3),  # rad/s
        ("warmth_time", "f8"),  # s since the sensors were switched on, at the start
        ("bound", "f8", 3),  # rad, s, share: errors of vertical, stamps and scale that are told
        ("stops", "i8"),  # 1: it ends when the lie is noticed, or GIVEN_UP after it began
        ("awaits", "i8"),  # what is told of the lie, -1 for the alarm
        ("flown", "f8"),  # s
        ("evidence", "f8", 4),  # the largest of each test
        ("error", "f8", 3),  # rad, s, share: the largest errors found
        ("alarm", "f8"),  # s, NaN without one
        ("test", "i8"),  # that gave the alarm
        ("told", "f8", 3),  # s, when each error was, NaN when it was not
        ("height", "f8"),  # m, true, at the alarm
        ("tilt", "f8"),  # rad, true, the largest until the alarm
        ("overruled", "i8", 2),  # number of alarms dismissed, by turns and by displacements
        ("crashed", "i8"),
    ],
    align=True,
)


@compiled(inner=True)
def _refer(t: float, s: Any, r: Any) -> bool:
    """Write the reference at t (s); return whether the motors run."""
    figure_eight_at(s.eight, t - (REST + CLIMB + HOVER), r)
    down = t - (REST + CLIMB + HOVER + EIGHT + HOVER)
    if t < REST + CLIMB:
        _climb(max(0.0, t - REST) / CLIMB, CLIMB, 0.0, HEIGHT, r)
        add_probe_at(t - PROBED, PROBE, r)
    elif down > 0.0:
        _climb(min(1.0, down / SINK), SINK, HEIGHT, -BELOW, r)
    return t >= REST and down < SINK


@compiled(inner=True)
def _climb(u: float, seconds: float, begin: float, end: float, r: Any) -> None:
    """Write a vertical motion from rest to rest, at the share u of its time."""
    way = end - begin
    r.position_w[2] = begin + way * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    r.velocity_w[2] = way * 30.0 * u * u * (1.0 - u) ** 2 / seconds
    r.acceleration_w[2] = way * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / seconds**2
    r.jerk_w[2] = way * (60.0 - 360.0 * u + 360.0 * u * u) / seconds**3
    r.snap_w[2] = way * (720.0 * u - 360.0) / seconds**4


@compiled(inner=True)
def _sense(
    f: Any, plant: Record, sensors: Record, noise: Any, registers: Any, stamp_ns: int
) -> None:
    """Sample the sensors and write the calibrated IMU_SAMPLE."""
    normals(f.random, noise[0])
    sensors[0].warmth = -math.expm1(-(f.warmth_time + 1e-9 * stamp_ns) / WARM_UP_TIME)
    sample(plant, sensors, noise, 0, registers)
    imu = f.onboard.imu
    imu.stamp_ns = stamp_ns
    for i in range(3):
        force, rate = registers[_ACCELEROMETER + i], registers[_GYROSCOPE + i]
        imu.specific_force_b[i] = ACCELEROMETER_SCALE * (force - ZERO)
        imu.angular_velocity_b[i] = GYROSCOPE_SCALE * (rate - ZERO) - f.gyroscope_bias_b[i]


@compiled(inner=True)
def _receive(
    f: Any, memory: Record, pose: Record, state: Record, stamp_ns: int, judged: bool
) -> None:
    """Give the poses that have arrived to the check, and to the filter."""
    t, v = f.tracker, f.onboard
    while t.given < t.taken and t.arrival_ns[t.given % UNDER_WAY] <= stamp_ns:
        z, out = t.pose[t.given % UNDER_WAY], pose[0]
        t.given += 1
        out.stamp_ns = z.stamp_ns
        for i in range(3):
            out.position_w[i] = z.position_w[i]
            state[0].velocity_w[i] = v.state.velocity_w[i]
        for i in range(4):
            out.quaternion_wb[i] = z.quaternion_wb[i]
        if judged:
            compare_pose(memory, pose, state)
        correct_one(v.estimator, out, f.settings.estimation, v.estimate)


@compiled(inner=True)
def _watch(f: Any, memory: Record, t: float) -> None:
    """Note evidence, alarm and what is told, t (s) into the flight."""
    found, m = errors(memory), memory[0]
    for i in range(3):
        size = abs(found[i]) if i != SCALE or found[3] > 1.0 else 0.0
        f.error[i] = max(f.error[i], size)
        if size > f.bound[i] and not f.told[i] >= 0.0:
            f.told[i] = t
    f.overruled[0], f.overruled[1] = m.overruled[0], m.overruled[1]
    for i in range(4):
        f.evidence[i] = max(f.evidence[i], m.evidence[i])
        if m.evidence[i] >= ALARM and strongest(m) >= ALARM and not f.alarm >= 0.0:
            f.alarm, f.test, f.height = t, i, f.plant.x[2]


@compiled(nogil=True)
def fly(
    flight: Record,
    plant: Record,
    sensors: Record,
    memory: Record,
    imu: Record,
    pose: Record,
    state: Record,
    actuators: Record,
    model: Record,
    noise: npt.NDArray[np.float64],
    registers: npt.NDArray[np.int16],
    wanted: npt.NDArray[np.float64],
    carry: npt.NDArray[np.float64],
) -> None:
    """Fly one FLIGHT (1,); the other arguments are buffers, filled from it."""
    f = flight[0]
    v, s, p, dt = f.onboard, f.settings, plant[0], 1e-9 * PERIOD_NS
    drawn = np.zeros(6)
    stamp_ns = 0
    count = round(STILL / dt)
    for _ in range(count):
        stamp_ns += PERIOD_NS
        _sense(f, plant, sensors, noise, registers, 0)
        for i in range(3):
            f.evidence[i] += v.imu.angular_velocity_b[i] / count
    for i in range(3):
        f.gyroscope_bias_b[i], f.evidence[i] = f.evidence[i], 0.0
    f.alarm = f.told[0] = f.told[1] = f.told[2] = math.nan
    v.estimator.initialized = 1
    v.estimator.pose_stamp_ns = v.estimator.newest_ns = -1
    v.estimator.pose[3] = 1.0
    for k in range(1, round(SECONDS / dt) + 1):
        t, stamp_ns = k * dt, k * PERIOD_NS
        blow(plant, noise[:, GUSTS:], 0, dt)
        advance(plant, (wanted[0], wanted[1], wanted[2], wanted[3]), dt)
        _sense(f, plant, sensors, noise, registers, stamp_ns)
        predict_one(v.estimator, v.imu, s.estimation, dt, v.state)
        copied = imu[0]
        copied.stamp_ns = stamp_ns
        for i in range(3):
            copied.specific_force_b[i] = v.imu.specific_force_b[i]
            copied.angular_velocity_b[i] = v.imu.angular_velocity_b[i]
        pressure = float(registers[_PRESSURE]) + PRESSURE_OFFSET
        note_sample(memory, imu, actuators, model, pressure)
        observe(f.tracker, p.x, stamp_ns, f.random, drawn)
        _receive(f, memory, pose, state, stamp_ns, True)
        for i in range(3):
            f.plant.x[i] = p.x[i]
        lean = 2.0 * (p.x[7] * p.x[7] + p.x[8] * p.x[8])
        f.tilt = max(f.tilt, math.acos(max(-1.0, 1.0 - lean)))
        f.flown = t
        _watch(f, memory, t)
        lies = t - 1e-9 * f.tracker.lies_ns
        noticed = f.alarm if f.awaits < 0 else f.told[f.awaits]
        if f.stops == 1 and (noticed >= 0.0 or lies > GIVEN_UP):
            return
        if not lean < 1.0:
            f.crashed = 1
            return
        motors_on = _refer(t, s, v.reference)
        airborne = motors_on and p.x[2] > 0.01
        step_one(v.controller, v.state, v.reference, s.control, s.model, airborne, dt, v.actuators)
        for i in range(4):
            wanted[i] = v.actuators.motor_references[i] if motors_on else 0.0
        actuators[0].wrench[0] = v.actuators.wrench[0] if motors_on else 0.0
        whole_references(wanted, carry)


def _tracker(world: str, seed: int, number: int, from_s: float) -> Record:
    t, chance = np.zeros(1, LYING_TRACKER), np.random.default_rng((seed, 3))
    t["interval_ns"], t["position_noise"] = 10_000_000, 0.001
    t["attitude_noise"], t["size"] = math.radians(0.2), 1.0
    t["lie"], t["lies_ns"] = number, round(1e9 * from_s)
    if world == "varied":
        t["interval_ns"] = round(1e9 / chance.choice([30.0, 60.0, 100.0, 120.0, 200.0]))
        t["delay_ns"] = round(1e9 * chance.uniform(0.0, 0.03))
        t["stamp_error_ns"] = round(1e9 * chance.uniform(-0.005, 0.005))
        t["position_noise"] = chance.uniform(0.0005, 0.003)
        t["attitude_noise"] = math.radians(chance.uniform(0.1, 0.6))
        t["drop_out"] = chance.uniform(0.0, 0.1)
        t["world_tilt"][0, :2] = np.radians(chance.uniform(-0.2, 0.2, 2))
        t["body_turn"] = np.radians(chance.uniform(-1.0, 1.0, 3) * (0.2, 0.2, 10.0))
        t["size"] = chance.uniform(0.99, 1.01)
    return t


def flight(world: str, seed: int, number: int = 0, from_s: float = ON_GROUND) -> Record:
    """Return a FLIGHT (1,) ready to fly."""
    out, chance = np.zeros(1, FLIGHT), np.random.default_rng((seed, 1))
    preset = "clean" if world == "clean" else "rough"
    biases = {f"accelerometer_bias_{axis}": chance.uniform(-0.05, 0.05) for axis in "xyz"}
    truth = SimulatorParameters.model_validate(preset_values(preset) | biases)
    eight = FigureEight((0.0, 0.0, HEIGHT))
    model = SimulatorParameters()
    out["settings"] = new_settings(eight, model, ControlParameters(), EstimationParameters())
    out["sensors"], out["plant"], out["onboard"] = (
        new_sensors(truth),
        new_plant(truth),
        new_onboard(),
    )
    out["plant"]["x"][0, 6] = 1.0
    out["tracker"], out["integrity"] = _tracker(world, seed, number, from_s), new_integrity()
    out["random"] = seeded([seed])
    out["warmth_time"] = chance.uniform(0.0, 600.0)
    p = SafetyParameters()
    tilt, size = math.radians(p.tracker_tilt_told), 0.01 * p.tracker_scale_told
    out["bound"] = tilt, p.tracker_stamps_told, size
    out["stops"], out["awaits"] = number > 0, TOLD.get(number, -1)
    return out


def fly_all(flights: Sequence[Record]) -> Record:
    """Fly all on all cores and return the FLIGHT records (N,)."""

    def one(each: Record) -> Record:
        state = each["onboard"]["state"].copy()
        fly(
            each,
            each["plant"].copy(),
            each["sensors"].copy(),
            each["integrity"].copy(),
            each["onboard"]["imu"].copy(),
            np.zeros(1, POSE_SAMPLE),
            state,
            each["onboard"]["actuators"].copy(),
            each["settings"]["model"].copy(),
            np.zeros((1, CHANNELS)),
            np.zeros(256, np.int16),
            np.zeros(4),
            np.zeros(4),
        )
        return each

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return np.concatenate(list(pool.map(one, flights)))


def run(size: Size = Size.FULL, hours: float | None = None) -> Report:
    """Return the false alarms in each world, and the times to notice each lie."""
    hours = hours or size.of(100.0, 1.0, 0.02)
    seeds = size.of(100, 20, 2)
    report = Report(
        "tracker_integrity",
        "A tracker that lies",
        [
            f"flights of {SECONDS:g} s: rest, take-off, hover, three laps of the 8, landing",
            "rough: the simulator's preset; varied: rough, on a tracker of 30 to 200 Hz, delayed "
            "by up to 30 ms, stamps off by up to 5 ms, noise to 3 mm and 0.6°, 10 % of the poses "
            "lost, world and body tilted by up to 0.2°, body turned by up to 10°, scale off by "
            "up to 1 %",
            f"{seeds} flights with each lie, which counts as not noticed after "
            f"{GIVEN_UP:g} s; its time "
            "from the start of the climb, below 0 at rest, or from its own",
            "height and tilt: true, when it is noticed; evidence and errors: the largest",
        ],
    )
    for world in WORLDS:
        share = 1.0 if world == WORLDS[0] else SHARE
        count = math.ceil(share * hours * 3600.0 / SECONDS)
        flown = fly_all([flight(world, seed) for seed in range(count)])
        honest = float(flown["flown"].sum()) / 3600.0
        alarms = int(np.isfinite(flown["alarm"]).sum())
        told = np.isfinite(flown["told"]).sum(axis=0).tolist()
        tilt, late, large = flown["error"].max(axis=0).tolist()
        figures: dict[str, float | str] = {
            "hours": honest,
            "alarms": alarms,
            "overruled": int(flown["overruled"].sum()),
            "evidence": float(flown["evidence"].max()),
            "vertical told": told[VERTICAL],
            "off, deg": math.degrees(tilt),
            "stamps told": told[STAMPS],
            "off, ms": 1e3 * late,
            "scale told": told[SCALE],
            "off, %": 100.0 * large,
        }
        report.rows.append(Row(f"{world}, no lie", figures))
        if world in ALLOWED:
            most = math.floor(honest * ALLOWED[world])
            report.targets.append(Target(f"false alarms, {world}", alarms + sum(told), most))
    for number, name in size.some(list(enumerate(LIES))[1:]):
        for when, from_s in BEGINS.items():
            for world in WORLDS[:2]:
                flown = fly_all([flight(world, seed, number, from_s) for seed in range(seeds)])
                report.rows.append(Row(f"{name}, {when}, {world}", _figures(flown, number, from_s)))
    crashed = 0
    for number, name in size.some([one for one in enumerate(LIES) if 0 < one[0] < min(TOLD)]):
        for world in WORLDS[:2]:
            landed = [take_off(seed, world, number) for seed in range(size.of(10, 2, 1))]
            crashed += sum(not one["upright"] for one in landed)
            of_all: dict[str, float | str] = {
                of: max(one[of] for one in landed) for of in landed[0] if of != "upright"
            }
            of_all["upright"] = sum(one["upright"] for one in landed) / len(landed)
            report.rows.append(Row(f"{name}, whole stack, {world}", of_all))
    report.targets.append(Target("vehicles turned over", crashed, 0))
    return report


def take_off(seed: int, world: str, number: int) -> dict[str, float]:
    """Take off with the whole stack on a tracker that lies from the start; return what it led to.

    The vehicle was put down at a random place and heading.
    """
    rough = preset_values("clean" if world == WORLDS[0] else "rough")
    chance = np.random.default_rng((seed, 5))
    x, y, yaw = chance.uniform(-1.0, 1.0, 3).tolist()
    flight = WatchedFlight(seed, {f"simulator.{name}": value for name, value in rough.items()})
    flight.robot.place((x, y, 0.0), (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)))
    stack: Any = flight.stack
    measure = stack.measure

    def wrong(message: Any) -> None:
        if isinstance(message, np.ndarray) and message.dtype == POSE_SAMPLE:
            message = message.copy()
            place, turn = message["position_w"][0], message["quaternion_wb"][0]
            p, q = lie(number, 0.0, tuple(place.tolist()), tuple(turn.tolist()))
            place[:], turn[:] = p, q
        measure(message)

    stack.measure = wrong
    flight.wait_until(lambda view: view.mode == "ready", what="ready", timeout=20.0)
    flight.wait(2.0)
    flight.arm()
    flight.wait(0.5)
    flight.start("take_off")
    flight.wait(3.0)
    upright = flight.down()
    _, places, _ = flight.trace()
    return {
        "upright": float(upright),
        "tilt, deg, at most": math.degrees(flight.most_tilted),
        "highest, m": float(places[:, 2].max()),
        "away, m": float(np.hypot(places[:, 0] - x, places[:, 1] - y).max()),
        "impact, m/s": flight.hardest,
    }


def _figures(flown: Record, number: int, from_s: float) -> dict[str, float | str]:
    begun = max(from_s, REST)
    noticed = (flown["told"][:, TOLD[number]] if number in TOLD else flown["alarm"]) - begun
    known = noticed[np.isfinite(noticed)]
    overruled = int((flown["overruled"] > 0).any(axis=1).sum())
    if not len(known):
        return {"noticed": 0.0, "overruled": overruled}
    return {
        "noticed": len(known) / len(flown),
        "overruled": overruled,
        "s, median": float(np.median(known)),
        "s, 95 %": float(np.quantile(known, 0.95)),
        "height, m, median": float(np.median(flown["height"])),
        "height, 95 %": float(np.quantile(flown["height"], 0.95)),
        "tilt, deg, 95 %": math.degrees(float(np.quantile(flown["tilt"], 0.95))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--hours", type=float, default=1.0)
    print(run(hours=parser.parse_args().hours).as_markdown())


if __name__ == "__main__":
    main()
