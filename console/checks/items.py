"""The pre-flight check list: one function per line, which depends only on facts and limits.

The vehicle itself refuses what docs/safety.md lists, and has the last word. The list shows the same
before a person tries to arm, together with what the vehicle does not have: disk, alarms, sticks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

from console.checks.facts import Facts
from console.parameters.preflight import PreflightParameters
from console.runs.disk import size_text
from vehicle_link.checks import Check, State
from vehicle_link.transport.heartbeat import LinkState

BEHIND = 2.0
"""Seconds by which the copy of the parameters may lag; a change is read back within one second."""
GRAVITY_OFF = 15.0
"""Largest angle, in deg, between gravity and the z axis of the tracker's attitude; a crooked
mounting may cause it."""
TURNED = 30.0
"""Largest turn, in deg, of the tracked body about the vertical; the tremor of a hand stays below
it."""
MISSED = 0.01
"""Share of the flight loop's periods without a tick from which a warning is shown."""
_SILENT = "nothing received"

Item = Callable[[Facts, PreflightParameters], Check]


def link(f: Facts, p: PreflightParameters) -> Check:
    advice = {
        LinkState.LOST: "is the vehicle switched on and in range?",
        LinkState.DEGRADED: "bring the antennas closer, or find what is loading the network",
    }
    state: State = "ok" if f.link is LinkState.GOOD else "fail"
    return Check("link", state, f"{f.link}", "good", advice.get(f.link, ""))


def clock(f: Facts, p: PreflightParameters) -> Check:
    if f.clock_known:
        return Check("vehicle's clock", "ok", "known", "known")
    return Check("vehicle's clock", "fail", "not known yet", "known", "wait for the link")


def telemetry(f: Facts, p: PreflightParameters) -> Check:
    found, wanted = f"{f.telemetry_rate:.0f} Hz", f"at least {p.telemetry_rate_min:.0f} Hz"
    if f.telemetry_rate < p.telemetry_rate_min:
        return Check("telemetry", "fail", found, wanted, "wait, or check the link's packet loss")
    if f.loss > p.loss_max:
        lost = f"{found}, {100 * f.loss:.0f} % lost"
        limit = f"at most {100 * p.loss_max:.0f} % lost"
        return Check("telemetry", "warn", lost, limit, "check the link's antennas and load")
    return Check("telemetry", "ok", found, wanted)


def mode(f: Facts, p: PreflightParameters) -> Check:
    if f.mode is None:
        return Check("mode", "fail", _SILENT, "ready", "wait for the vehicle")
    advice = {
        "cut": "the motors were cut: find out why, then press Disarm to acknowledge",
        "emergency_land": "wait until it has landed",
        "starting": "wait for the gyroscope's calibration",
        "bench": "a motor is on the bench: wait, or press Disarm to end it",
    }
    state: State = "ok" if f.mode == "ready" else "fail"
    found = f.mode.replace("_", " ")
    return Check("mode", state, found, "ready", advice.get(f.mode, "wait for the vehicle"))


def gyroscope(f: Facts, p: PreflightParameters) -> Check:
    if f.mode is None:
        return Check("gyroscope", "unknown", _SILENT, "calibrated")
    if "gyro_uncalibrated" in f.flags:
        return Check("gyroscope", "fail", "not calibrated", "calibrated", "keep the vehicle still")
    return Check("gyroscope", "ok", "calibrated", "calibrated")


def estimator(f: Facts, p: PreflightParameters) -> Check:
    wanted = (
        f"at most {1e3 * p.position_innovation_max:.0f} mm and {p.attitude_innovation_max:.1f}° off"
    )
    if f.position_innovation is None or f.attitude_innovation is None:
        return Check("estimator", "fail", _SILENT, wanted, "wait for the vehicle")
    angle = math.degrees(f.attitude_innovation)
    found = f"{1e3 * f.position_innovation:.0f} mm, {angle:.1f}° from the measured pose"
    converged = f.position_innovation <= p.position_innovation_max
    converged &= angle <= p.attitude_innovation_max
    advice = "wait until it has converged; else compare the tracker's axes with the vehicle's"
    return Check("estimator", "ok" if converged else "fail", found, wanted, advice)


def consistency(f: Facts, p: PreflightParameters) -> Check:
    """Check that the estimate and its measurements agree, as far as the estimator can tell."""
    name = "consistency"
    wanted = f"at most {p.consistency_max:g}, {100 * p.refused_share_max:.0f} % refused"
    if f.position_innovation is None:
        return Check(name, "unknown", _SILENT, wanted)
    if "rescued" in f.flags:
        advice = "check the adapted noise (chart layout Estimator)"
        return Check(name, "warn", "on the shadow", "the estimator chosen", advice)
    if math.isnan(f.consistency):
        return Check(name, "ok", "not reported by this estimator", wanted)
    found = f"{f.consistency:.1f}, {100 * f.refused_share:.0f} % refused"
    good = f.consistency <= p.consistency_max and f.refused_share <= p.refused_share_max
    advice = (
        "wait until it has converged; if it does not, check the tracker's stamps, axes and noise"
    )
    return Check(name, "ok" if good else "fail", found, wanted, advice)


def measurements(f: Facts, p: PreflightParameters) -> Check:
    """Check the age of the pose behind the estimate, and that tracker poses keep arriving."""
    name = "measurements"
    least = p.tracker_share_min * f.tracker_nominal
    if f.tracker_rate < least:
        advice = "is the tracking system (or the simulator) running, the vehicle in its view?"
        return Check(
            name, "fail", f"tracker at {f.tracker_rate:.0f} Hz", f"at least {least:.0f} Hz", advice
        )
    wanted = f"at most {1e3 * p.pose_age_max:.0f} ms"
    if f.pose_age is None:
        return Check(name, "fail", _SILENT, wanted, "wait for the vehicle")
    found = f"pose {1e3 * f.pose_age:.0f} ms old" if math.isfinite(f.pose_age) else "no pose yet"
    fresh = f.pose_age <= p.pose_age_max and "no_pose" not in f.flags
    return Check(name, "ok" if fresh else "fail", found, wanted, "check the tracker and the link")


def battery(f: Facts, p: PreflightParameters) -> Check:
    limit = max(p.battery_min, f.battery_warning or 0.0)
    wanted, advice = f"at least {limit:.1f} V", "charge or change the battery"
    if f.voltage is None:
        return Check("battery", "fail", _SILENT, wanted, "wait for the vehicle")
    good = f.voltage >= limit and "battery_low" not in f.flags  # NaN is not
    return Check("battery", "ok" if good else "fail", f"{f.voltage:.1f} V", wanted, advice)


def level_and_still(f: Facts, p: PreflightParameters) -> Check:
    name = "level and still"
    wanted = f"at most {p.tilt_max:.0f}°, {p.speed_max:.2f} m/s, {p.body_rate_max:.0f}°/s"
    if f.tilt is None or f.speed is None or f.body_rate is None:
        return Check(name, "fail", _SILENT, wanted, "wait for the vehicle")
    tilt, rate = math.degrees(f.tilt), math.degrees(f.body_rate)
    found = f"{tilt:.1f}°, {f.speed:.2f} m/s, {rate:.1f}°/s"
    if f.airborne:
        return Check(name, "fail", "in the air", "on the ground", "land first")
    good = tilt <= p.tilt_max and f.speed <= p.speed_max and rate <= p.body_rate_max
    advice = "set it on level ground and let go of it"
    return Check(name, "ok" if good else "fail", found, wanted, advice)


def tracked_body(f: Facts, p: PreflightParameters) -> Check:
    """Check the direction of gravity by the accelerometer against the tracker's attitude: if they
    differ, the axes of the tracked body are not those of the vehicle.
    """
    name, wanted = "tracked body", f"gravity at most {GRAVITY_OFF:.0f}° off"
    if f.body_turn is not None and abs(math.degrees(f.body_turn)) > TURNED:
        advice = (
            "tilt the vehicle by 20° by hand, hold it, and check again; then turn the body in "
            "the tracking system, or calibrate tracker_body"
        )
        found = f"turned by {math.degrees(f.body_turn):+.0f}° about the vertical when tilted"
        return Check(name, "fail", found, f"turned by at most {TURNED:.0f}°", advice)
    if f.gravity_off is None:
        return Check(name, "unknown", _SILENT, wanted)
    off = math.degrees(f.gravity_off)
    advice = (
        "the tracked body's axes are turned or mirrored: correct them in the tracking system, or "
        "calibrate tracker_body"
    )
    state: State = "ok" if off <= GRAVITY_OFF else "fail"
    seen = "unknown until it is tilted by hand" if f.body_turn is None else "verified"
    found = f"gravity {off:.0f}° off; turn about the vertical {seen}"
    return Check(name, state, found, wanted, advice)


def flight_volume(f: Facts, p: PreflightParameters) -> Check:
    """Check the position against the flight volume: a vehicle on the ground may be below its floor,
    but none may be above its ceiling or outside its sides.
    """
    name = "flight volume"
    if f.position_w is None or f.volume is None:
        return Check(name, "fail", _SILENT, "inside", "wait for the vehicle")
    (x_min, x_max), (y_min, y_max), (_, z_max) = f.volume
    x, y, z = f.position_w
    inside = x_min <= x <= x_max and y_min <= y <= y_max and z <= z_max
    wanted = f"x {x_min:g} to {x_max:g}, y {y_min:g} to {y_max:g}, z below {z_max:g} m"
    found = f"at {x:.2f}, {y:.2f}, {z:.2f} m"
    advice = "carry the vehicle inside, or change the flight volume on the Settings page"
    if inside and (box := next((box for box in f.boxes if box.gap(f.position_w) < 0.0), None)):
        inside, found = False, f"{found}, in the keep-out box {box.name}"
        wanted, advice = "outside of it", "carry the vehicle out, or change behavior.keep_out"
    return Check(name, "ok" if inside else "fail", found, wanted, advice)


def parameters(f: Facts, p: PreflightParameters) -> Check:
    wanted = "those of the vehicle"
    if f.parameters_behind is None:
        return Check("parameters", "fail", "not read yet", wanted, "wait for the link")
    if f.parameters_behind > BEHIND:
        found = f"{f.parameters_behind:.0f} s behind the vehicle's"
        return Check("parameters", "fail", found, wanted, "wait, or check the link")
    return Check("parameters", "ok", "up to date", wanted)


def recording(f: Facts, p: PreflightParameters) -> Check:
    found, wanted = f"{size_text(f.free_bytes)} free", f"at least {size_text(f.keep_free)}"
    problem, advice = f.folder_problem
    if problem:
        return Check("recording", "fail", problem, "a folder to write runs into", advice)
    if f.free_bytes < f.keep_free:
        return Check("recording", "fail", found, wanted, "delete or move runs")
    return Check("recording", "ok", found, wanted)


def alarms(f: Facts, p: PreflightParameters) -> Check:
    if f.alarms:
        advice = "see the alarms; restart quadlab if one of them does not clear"
        return Check("alarms", "fail", "; ".join(f.alarms), "none", advice)
    if f.notices:
        return Check("alarms", "warn", "; ".join(f.notices), "none", "see the alarms")
    return Check("alarms", "ok", "none", "none")


def sticks(f: Facts, p: PreflightParameters) -> Check:
    if f.sticks_dropped:
        return Check("sticks", "fail", "dropped", "centred", "release the dead-man")
    limit = f"centred within {100 * p.stick_deflection_max:.0f} %"
    state: State = "ok" if f.deflection <= p.stick_deflection_max else "fail"
    found = f"deflected by {100 * f.deflection:.0f} %" if f.deflection else "centred"
    return Check("sticks", state, found, limit, "let go of the sticks, or calibrate the pad")


def flight_loop(f: Facts, p: PreflightParameters) -> Check:
    """Check the flight loop. A problem only gives a warning, because a simulation is seldom real
    time.
    """
    wanted = "real time, at most 1 % of its periods missed"
    if f.mode is None:
        return Check("flight loop", "unknown", _SILENT, wanted)
    missed = f"{100 * f.missed_share:.1f} % missed"
    if "not_real_time" in f.flags:
        advice = "give the vehicle its real-time rights: see the Settings page"
        return Check("flight loop", "warn", f"not real time, {missed}", wanted, advice)
    state: State = "ok" if f.missed_share <= MISSED else "warn"
    return Check(
        "flight loop", state, missed, wanted, "find what is loading the vehicle's computer"
    )


ITEMS: tuple[Item, ...] = (
    link,
    clock,
    telemetry,
    mode,
    gyroscope,
    estimator,
    consistency,
    measurements,
    battery,
    level_and_still,
    tracked_body,
    flight_volume,
    parameters,
    recording,
    alarms,
    sticks,
    flight_loop,
)


def judged(facts: Facts, limits: PreflightParameters) -> list[Check]:
    """Return the whole list, in its order. Only `fail` keeps the vehicle on the ground.

    Without a link, the link is the reason; everything else about a silent vehicle is unknown.
    """
    checks = [item(facts, limits) for item in ITEMS]
    if facts.link is not LinkState.LOST:
        return checks
    silent = (_SILENT, "0 Hz")
    return [replace(one, state="unknown") if one.found in silent else one for one in checks]


def reasons(checks: Iterable[Check]) -> list[str]:
    """Return the reasons of the checks that fail: what was found, what is required and what to do,
    in one line each.
    """
    return [
        f"{one.name}: {one.found}, required: {one.wanted}; {one.advice}"
        for one in checks
        if one.state == "fail"
    ]
