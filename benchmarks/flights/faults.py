"""Fly through pushes, loads, empty batteries and silence, compared with reference figures.

    python -m benchmarks faults

Simulated time: real stack, simulated firmware and plant, full sensors, default gains. The
references are those of an independent simulation of the same vehicle; a figure should be within 30
% of its reference. Where the implementation differs by design, the row says so.
"""

from __future__ import annotations

import math
import os
import traceback
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import numpy as np

from benchmarks.flights.watched_flight import WatchedFlight
from benchmarks.harness import Report, Row, Size, Target
from quadrotor.parameter_description import ParameterValue
from vehicle.simulator.parameters import SimulatorParameters
from vehicle_link.serial.ids import Id

SEEDS = 3
WITHIN = 0.3
GUSTS = {1.0: 0.16, 2.0: 0.31, 4.0: 0.62}
"""Force (N) for 1 s in hover -> largest displacement, m."""
PAYLOAD = 0.3
SAG, SAG_MASS = 0.25, 0.20
"""Sag, in m below the hover height, without and with the mass estimate in the law."""
TOUCH_DOWN = 0.54
"""Touch-down speed, in m/s, of a descent held by the barometer."""
HEIGHTS = (1.0, 2.0, 2.8)
TIMEOUTS = (0.1, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8)
TIMEOUT_MAX = 0.3
STEEP_PERIOD = 6.8
"""Duration, in s, of the 8 from rest to rest that tilts the vehicle by 37 deg."""
STEEP: dict[str, ParameterValue] = {
    "behavior.trajectory_acceleration_max": 8.0,
    "behavior.trajectory_tilt_max": 45.0,
}
EMPTY = 12.6
"""Voltage, in V, of an empty battery; the landing at 13.1 V is off on board, the microcontroller's
own is on."""
GOOD_LANDING = 0.8
"""Largest touch-down speed, in m/s, of a good landing."""


def run(size: Size = Size.FULL) -> Report:
    seeds = range(1, size.of(SEEDS, 1, 1) + 1)
    report = Report(
        "faults",
        "Gusts, payload, empty battery, lost link",
        [
            f"simulated time, {len(seeds)} seed{'s' * (len(seeds) > 1)}, median of the seeds and "
            "the one farthest from it; full sensors at 500 Hz, control gains `standard`, hover at "
            "1 m unless said",
            "gust: a force for 1 s, along x, y and between in turns; payload: hung on in hover",
            "no commands: the flight process stands still; the microcontroller lands on its own",
            "held commands: the last motor references of the 8 from rest to rest, at most 37° of "
            "tilt, act on until the timeout; tried at every 0.2 s of the lap",
        ],
    )
    panels = [
        _gusts(report, seeds),
        _payload(report, seeds),
        _battery(report, size),
        _timeouts(report, size.of(0.2, 0.6, 5.0)),
    ]
    _descents(report, seeds, size.some(HEIGHTS))
    report.plot = {"kind": "lines", "panels": panels}
    report.notes += [
        "the law flies on `model.mass` unless `mass.used_by` is `estimate`",
        "the microcontroller's own emergency slows to 0.35 m/s below 0.7 m, so it touches down "
        "softer than the reference: meant, and no target; without that flare the flight "
        "computer's descent at 0.5 m/s is what the reference describes",
        "battery: hovered until the microcontroller lands, 13.1 V for 1 s; where the curve falls "
        "off the height goes with it. There is no reference",
    ]
    return report


# ---------------------------------------------------------------- pushed and loaded
def _gusts(report: Report, seeds: range) -> dict[str, Any]:
    directions = ((1.0, 0.0), (0.0, 1.0), (math.sqrt(0.5), math.sqrt(0.5)))
    farthest: dict[float, list[float]] = {force: [] for force in GUSTS}
    lines = []
    for seed in seeds:
        flight = WatchedFlight(seed).hover()
        x, y = directions[seed % 3]
        for force, found in farthest.items():
            flight.forget()
            flight.robot.disturb((force * x, force * y, 0.0))
            flight.run(1.0)
            flight.robot.disturb((0.0, 0.0, 0.0))
            flight.run(7.0)
            times, true, wanted = flight.trace()
            away = np.linalg.norm(true - wanted, axis=1)
            found.append(float(away.max()))
            if seed == seeds[0]:
                lines.append(_line(f"{force:g} N", times, away))
    for force, reference in GUSTS.items():
        _compare(report, f"gust of {force:g} N: displacement, m", farthest[force], reference)
    return _panel("time, s", "displacement by a gust, m", lines)


def _payload(report: Report, seeds: range) -> dict[str, Any]:
    lines = []
    for estimated, reference in ((False, SAG), (True, SAG_MASS)):
        sags = []
        for seed in seeds:
            flight = WatchedFlight(seed, {"mass.used_by": "estimate" if estimated else "model"})
            flight.hover()
            flight.run(3.0)
            flight.forget()
            flight.disturb(payload=PAYLOAD)
            flight.run(10.0)
            times, true, wanted = flight.trace()
            height = true[:, 2] - wanted[:, 2]
            sags.append(float(-height.min()))
            if seed == seeds[0]:
                label = "flown on the mass estimate" if estimated else "as built"
                lines.append(_line(label, times, height))
        what = ", flown on the mass estimate" if estimated else ""
        _compare(report, f"payload + {PAYLOAD:g} kg{what}: sag, m", sags, reference)
    return _panel("time, s", f"height after + {PAYLOAD:g} kg, m", lines)


# ---------------------------------------------------------------- the battery
def _battery(report: Report, size: Size) -> dict[str, Any]:
    """Fly a whole discharge in hover: thrust falls with the square of the voltage."""
    lines, capacity = [], SimulatorParameters().battery_capacity
    for known in (0.0, 1.0):
        flight = WatchedFlight(
            1,
            {
                "simulator.battery_exponent": 1.0,
                "model.battery_exponent": known,
                "simulator.battery_charge": size.of(1.0, 0.15, 0.15),
                "simulator.battery_capacity": size.of(capacity, capacity, 1.0),
                "safety.battery_land": 12.0,
                "safety.battery_warning": 12.1,
            },
        )
        flight.hover()
        flight.forget()
        volts = []
        while flight.view().mode == "armed" and flight.robot.battery_voltage > EMPTY:
            flight.advance()
            volts.append(flight.robot.battery_voltage)
        times, true, wanted = flight.trace()
        height, voltage = true[:, 2] - wanted[:, 2], np.array(volts)
        plateau = voltage > 14.0
        report.rows.append(
            Row(
                "battery, motor law follows the voltage" if known else "battery, as built",
                {
                    "measured": float(-height.min()),
                    "hovered, s": float(times[-1] - times[0]),
                    "sag above 14 V, m": float(-height[plateau].min()) if plateau.any() else "",
                    "ended at, V": float(voltage[-1]),
                },
            )
        )
        label = "motor law follows the voltage" if known else "as built"
        lines.append(
            {
                "label": label,
                "x": voltage[::250].round(3).tolist(),
                "y": height[::250].round(5).tolist(),
            }
        )
    return _panel("battery, V", "height while it empties, m", lines, reverse_x=True)


# ---------------------------------------------------------------- silenced
def _descents(report: Report, seeds: range, heights: Sequence[float]) -> None:
    """Measure touch-down speeds from several heights."""
    for height in heights:
        hardest, upright = [], []
        for seed in seeds:
            flight = WatchedFlight(seed).hover(height)
            flight.forget()
            flight.frozen = True
            flight.run(0.5)
            upright.append(flight.down())
            hardest.append(flight.hardest)
        what = f"no commands, from {height:g} m: touch-down, m/s"
        _compare(report, what, hardest, TOUCH_DOWN, meant=True)
        report.rows[-1].figures["upright"] = f"{sum(upright)} of {len(upright)}"
        report.targets.append(
            Target(f"no commands, from {height:g} m: worst touch-down, m/s", max(hardest), 0.8)
        )
        report.targets.append(
            Target("the same, landed upright, share", sum(upright) / len(upright), 1.0, False)
        )
    settings: dict[str, ParameterValue] = {"near_hovering.flare_height": 0.0}
    for height in heights:
        hardest = []
        for seed in seeds:
            flight = WatchedFlight(seed, settings).hover(height)
            flight.forget()
            flight.parameters.tracker.drop_out = 1.0
            flight.down()
            hardest.append(flight.hardest)
        what = f"pose lost, descent at 0.5 m/s without flare, from {height:g} m: touch-down, m/s"
        _compare(report, what, hardest, TOUCH_DOWN)


def _timeouts(report: Report, step: float) -> dict[str, Any]:
    """Hold commands in a steep 8, and measure how long this is recoverable."""
    flight = WatchedFlight(1, STEEP).hover(1.5)
    flight.start(
        "follow_trajectory", trajectory="figure_eight_lap", period=STEEP_PERIOD, yaw_amplitude=0.2
    )
    flight.forget()
    good = dict.fromkeys(TIMEOUTS, 0)
    most = dict.fromkeys(TIMEOUTS, 0.0)
    moments = math.floor(STEEP_PERIOD / step)
    steepest = 0.0
    for _ in range(moments):
        flight.run(step)
        steepest = max(steepest, flight.most_tilted)
        for timeout in TIMEOUTS:
            upright, impact, tilt = in_a_copy(lambda t=timeout: _silence(flight, t))  # type: ignore[misc]
            good[timeout] += upright and impact <= GOOD_LANDING
            most[timeout] = max(most[timeout], tilt)
    for timeout in TIMEOUTS:
        report.rows.append(
            Row(
                f"commands held for {timeout:g} s: largest tilt, deg",
                {"measured": most[timeout], "upright": f"{good[timeout]} of {moments}"},
            )
        )
    held = [timeout for timeout in TIMEOUTS if good[timeout] == moments]
    report.conditions.append(f"steepest of the steep 8: {math.degrees(steepest):.0f}°")
    report.targets.append(
        Target(
            "longest timeout that always lands well, s",
            max(held, default=0.0),
            TIMEOUT_MAX,
            at_most=False,
        )
    )
    report.rows[-len(TIMEOUTS)].figures["reference"] = f"≤ {TIMEOUT_MAX:g} s lands"
    line = {"label": "largest tilt", "x": list(TIMEOUTS), "y": [most[t] for t in TIMEOUTS]}
    share = {
        "label": "landings that failed, %",
        "x": list(TIMEOUTS),
        "y": [100.0 * (1 - good[t] / moments) for t in TIMEOUTS],
    }
    return _panel("last command held for, s", "tilt, deg; failed, %", [line, share])


def _silence(flight: WatchedFlight, timeout: float) -> tuple[bool, float, float]:
    """Stop the flight process from now on.

    Returns whether it ended upright, the impact (m/s) and the largest tilt (deg).
    """
    flight.robot.firmware.registers[Id.EMERGENCY_TIMEOUT] = round(1e3 * timeout)
    flight.forget()
    flight.frozen = True
    flight.run(timeout + 0.5)
    upright = flight.down(15.0)
    return upright, flight.hardest, math.degrees(flight.most_tilted)


def in_a_copy(call: Callable[[], Any]) -> Any:
    """Return the result of a call in a forked process; this process's flight is unchanged."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.write(writer, msgspec.json.encode(call()))
        except BaseException:
            traceback.print_exc()  # the reader finds no answer
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as answer:
        data = answer.read()
    os.waitpid(child, 0)
    return msgspec.json.decode(data)


# ---------------------------------------------------------------- rows and lines
def _compare(
    report: Report, what: str, found: list[float], reference: float, *, meant: bool = False
) -> None:
    """Add a row with the ratio; a target both ways, unless a difference is `meant`."""
    values = np.array(found)
    median = float(np.median(values))
    farthest = float(values[np.abs(values - median).argmax()])
    ratio = median / reference
    report.rows.append(
        Row(
            what,
            {"measured": median, "farthest seed": farthest, "reference": reference, "ratio": ratio},
        )
    )
    if not meant:
        report.targets.append(
            Target(f"{what}: share by which it differs from the reference", abs(ratio - 1), WITHIN)
        )


def _line(label: str, times: Any, values: Any) -> dict[str, Any]:
    """Return a line of at most some hundred points."""
    keep = slice(None, None, max(1, len(times) // 400))
    return {
        "label": label,
        "x": (times[keep] - times[0]).round(4).tolist(),
        "y": values[keep].round(5).tolist(),
    }


def _panel(x: str, y: str, lines: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    return {"x_label": x, "y_label": y, "lines": lines, **more}
