"""Pushes, loads, an empty battery and silence, in hover or in a steep 8."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.campaigns.watching import Watching
from benchmarks.flights.watched_flight import Observed
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Array
from vehicle_link.serial.ids import Id

PAYLOAD = 0.3
"""kg that are hung on in hover."""
PLATEAU, EMPTY = 14.0, 12.6
"""Voltages, in V, above which the curve is flat, and of an empty battery."""
STEEP_PERIOD = 6.8
"""Duration, in s, of the 8 from rest to rest that tilts the vehicle by 37 deg."""
GOOD_LANDING = 0.8
"""Largest touch-down speed, in m/s, of a good landing."""
DIAGONAL = math.sqrt(0.5)
DIRECTIONS = ((1.0, 0.0), (0.0, 1.0), (DIAGONAL, DIAGONAL))


class FaultOptions(Parameters):
    """Options: what happens in flight."""

    fault: str = parameter(
        "gust", choices=("gust", "payload", "battery", "silent", "pose lost", "held")
    )
    """gust: a force for 1 s; payload: hung on; battery: hovered until it is empty; silent: the
    flight process stands still; held: it does in a steep 8; pose lost: no poses"""
    force: float = parameter(1.0, unit="N", ge=0.0, le=20.0)
    """of a gust"""
    height: float = parameter(1.0, unit="m", ge=0.3, le=3.0)
    """of the hover"""
    moment: float = parameter(1.0, unit="s", ge=0.0, le=STEEP_PERIOD)
    """in the steep 8"""
    timeout: float = parameter(0.25, unit="s", ge=0.05, le=2.0)
    """for which the microcontroller holds the last commands"""


class Faults(Watching):
    """A flight with a fault, watched until its end."""

    name = "faults"

    def __init__(self) -> None:
        super().__init__()
        self.parameters: FaultOptions = FaultOptions()
        self.times = np.zeros(0)
        self.volts: list[float] = []
        self.away: Array = np.zeros((0, 3))

    def fly(self, client: Observed) -> None:
        """Hover, let it happen, and keep figures and, for a curve, distances from the reference."""
        options = self.parameters
        client.hover(options.height)
        client.forget()
        {
            "gust": self._gust,
            "payload": self._payload,
            "battery": self._battery,
            "silent": self._silent,
            "pose lost": self._pose_lost,
            "held": self._held,
        }[options.fault](client)
        self.times, true, wanted = client.trace()
        self.away = true - wanted
        below = float(-self.away[:, 2].min())
        self.found |= {
            "displacement_m": float(np.linalg.norm(self.away, axis=1).max()),
            "sag_m": below,
            "touch_down_m_s": client.hardest,
        }

    def _gust(self, client: Observed) -> None:
        x, y = DIRECTIONS[client.parameters.simulator.seed % 3]
        force = self.parameters.force
        client.robot.disturb((force * x, force * y, 0.0))
        client.run(1.0)
        client.robot.disturb((0.0, 0.0, 0.0))
        client.run(7.0)

    def _payload(self, client: Observed) -> None:
        client.run(3.0)
        client.forget()
        client.disturb(payload=PAYLOAD)
        client.run(10.0)

    def _battery(self, client: Observed) -> None:
        while client.view().mode == "armed" and client.robot.battery_voltage > EMPTY:
            client.advance()
            self.volts.append(client.robot.battery_voltage)
        times, true, wanted = client.trace()
        flat = np.array(self.volts) > PLATEAU
        below = wanted[flat, 2] - true[flat, 2]
        self.found = {
            "hovered_s": float(times[-1] - times[0]),
            "ended_at_v": self.volts[-1],
            **({"sag_above_14_v_m": float(below.max())} if len(below) else {}),
        }

    def _silent(self, client: Observed) -> None:
        client.frozen = True
        client.run(0.5)
        self.found = {"upright": float(client.down())}

    def _pose_lost(self, client: Observed) -> None:
        client.parameters.tracker.drop_out = 1.0
        self.found = {"upright": float(client.down())}

    def _held(self, client: Observed) -> None:
        client.start(
            "follow_trajectory",
            trajectory="figure_eight_lap",
            period=STEEP_PERIOD,
            yaw_amplitude=0.2,
        )
        timeout = self.parameters.timeout
        client.run(self.parameters.moment)
        steepest = math.degrees(client.most_tilted)
        client.robot.firmware.registers[Id.EMERGENCY_TIMEOUT] = round(1e3 * timeout)
        client.forget()
        client.frozen = True
        client.run(timeout + 0.5)
        upright = client.down(15.0)
        self.found = {
            "steepest_deg": steepest,
            "most_tilted_deg": math.degrees(client.most_tilted),
            "landed_well": float(upright and client.hardest <= GOOD_LANDING),
        }
