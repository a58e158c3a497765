"""Flights in simulated time in which something above the microcontroller fails."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.flights.touch_down import Outcome, TouchDown
from benchmarks.flights.watched_flight import Observed, WatchedFlight
from quadrotor.errors import LinkError
from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue

STARTS = ("hover 1 m", "hover 2 m", "hover 3 m", "figure 8", "lap", "climb")
SILENT = "flight killed or frozen"
CORRUPTED = "5 % of the bytes"
FAILURES = ("station", "comms", SILENT, "port 0", "port 1", "both ports", CORRUPTED, "tracker")
SETTINGS: dict[str, ParameterValue] = {
    "behavior.trajectory_acceleration_max": 8.0,
    "behavior.trajectory_tilt_max": 45.0,
    "behavior.volume_z_max": 3.5,
}
"""Settings of the vehicle that allow the lap in 7 s, which leans by 35 degrees, and 3 m of height
from a ground that is not quite at 0; those of the plans, too."""
CORRUPTED_FOR = 15.0
"""Time, in s, flown with corrupted bytes before the landing, during which they continue."""
LONGEST = 45.0
"""Longest time, in s, from the failure to its end."""
DRAG = 0.25
"""N s/m, through which the wind acts."""


def conditions(seed: int) -> dict[str, ParameterValue]:
    """Return the truth of a seed: wind, gusts, motors, battery, drift of the gyroscope."""
    chance = np.random.default_rng((seed, 11))
    speed, heading = chance.uniform(0.0, 1.0), chance.uniform(-math.pi, math.pi)
    drift = chance.normal(0.0, 1.0, 3)
    return {
        "wind_x": round(speed * math.cos(heading), 2),
        "wind_y": round(speed * math.sin(heading), 2),
        "gust": 0.5,
        "thrust_efficiency": round(chance.uniform(0.95, 1.05), 3),
        "battery_charge": round(chance.uniform(0.5, 1.0), 2),
        "gyroscope_bias_x": round(drift[0], 2),
        "gyroscope_bias_y": round(drift[1], 2),
        "gyroscope_bias_z": round(drift[2], 2),
    }


class Failing(Observed):
    """A flight whose station can be silent and whose flight process can fail.

    Attributes:
        heard: whether the station's heartbeat and poses arrive.
    """

    heard = True

    def _station(self, now_ns: int) -> None:
        if self.heard:
            super()._station(now_ns)

    def lose_tracker(self) -> None:
        """Stop all pose measurements."""
        self._next_truth_ns = 10**18

    def advance(self) -> None:
        try:
            super().advance()
        except LinkError:  # the last port is lost: the flight process ends
            self.frozen = True


class FailingFlight(Failing, WatchedFlight):
    """The same without a plan."""


def bring_to(flight: Failing, start: str, chance: np.random.Generator) -> None:
    """Fly to a random moment of a start. Raises RefusedError."""
    _bring_to(flight, STARTS[0])
    if start != STARTS[0]:
        _bring_to(flight, start)
    if start.startswith("hover"):
        flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=60)
    flight.wait(float(chance.uniform(0.0, 8.0 if start == "figure 8" else 2.0)))
    if start == "lap":
        flight.start(
            "follow_trajectory", trajectory="figure_eight_lap", period=7.0, yaw_amplitude=0.2
        )
        flight.wait(float(chance.uniform(1.0, 6.0)))


def _bring_to(flight: Failing, start: str) -> None:
    if start == "hover 1 m":
        flight.hover(1.0)
        return
    if start == "climb":
        flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=60)
        flight.start("land")
        flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=60)
        flight.arm()
        flight.wait(1.0)
        flight.start("take_off", height=1.0)
        return
    if start.startswith("hover"):
        flight.start("fly_to", x=0.0, y=0.0, z=float(start.split()[1]), yaw=0.0)
    elif start == "figure 8":
        flight.start("fly_to", x=0.0, y=0.0, z=1.0, yaw=0.0)
        flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=30)
        flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
        flight.wait(4.0)
        return
    flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=60)
    flight.wait(1.0)


def watch_failure(flight: Failing, failure: str, outcome: Outcome, outage: float = 1.0) -> None:
    """Cause the failure now, and continue until it is down with its motors off.

    Args:
        outage: s until comms is back, which is then commanded to land.
    """
    robot = flight.robot
    land_at = {"comms": outage + 1.0, CORRUPTED: CORRUPTED_FOR}.get(failure, math.inf)
    begun = robot.stamp_ns * 1e-9
    watch = TouchDown(outcome, begun, robot.truth["position_w"][0].tolist())
    break_it(flight, failure)
    while (now := robot.stamp_ns * 1e-9 - begun) < LONGEST:
        flight.advance()
        truth = robot.truth[0]
        watch.note(
            begun + now,
            truth["position_w"].tolist(),
            float(truth["velocity_w"][2]),
            truth["quaternion_wb"].tolist(),
        )
        if failure == "comms" and not flight.heard and now > outage:
            flight.heard = True
        if now > land_at and flight.view().behavior in ("hover", "brake", "follow_trajectory"):
            flight.start("land")
        if (
            math.isnan(outcome.off)
            and robot.firmware.motor_state is not MotorState.ON
            and (robot.firmware.motor_state is not MotorState.EMERGENCY)
        ):
            outcome.off = now
        if now > outcome.off + 0.5 and not math.isnan(outcome.down):
            return


def break_it(flight: Failing, failure: str) -> None:
    """Cause the failure itself."""
    if failure in ("station", "comms"):
        flight.heard = False
    elif failure == SILENT:
        flight.frozen = True
    elif failure == "tracker":
        flight.lose_tracker()
    elif failure == CORRUPTED:
        flight.disturb(corrupted_bytes=0.05)
    else:
        unplugged = {"port 0": "first", "port 1": "second", "both ports": "both"}[failure]
        flight.disturb(unplugged_port=unplugged)
