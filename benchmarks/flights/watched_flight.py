"""Flights of the whole stack in simulated time, with the truth recorded and faults on request."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np

from quadlab.simulated.flight import SimulatedFlight, TrueState
from quadlab.simulated.parameters import FlightParameters, with_groups
from quadlab.simulated.sensors import new_flight_parameters
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.records import Array
from vehicle import mailbox
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle.estimators.offer import offer_plugins
from vehicle.simulator.boards import firmware_of
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

TOUCHING = 0.005
"""Height, in m, below which the vehicle touches the ground."""


class Events:
    """Texts of the vehicle's events, in their order; a log that drops every other message."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def event(self, event: mailbox.Event) -> None:
        self.texts.append(event.text)

    def __getattr__(self, _: str) -> Callable[..., None]:
        return lambda *_: None


class Observed(SimulatedFlight):
    """A flight that sees the truth at each sample, and whose flight process can stand still.

    Attributes:
        events: of the vehicle.
        frozen: whether the flight process is stopped: nothing is sent to the microcontroller.
        hardest: largest speed at touch-down, m/s.
        most_tilted: rad, since this was last set to 0.
    """

    def __init__(
        self, parameters: FlightParameters, simulated: SimulatedVehicle, *others: Any, **named: Any
    ) -> None:
        super().__init__(parameters, simulated, *others, **named)
        self.robot = simulated
        self.events = Events()
        self.frozen = False
        self.hardest = self.most_tilted = 0.0
        self._trace: list[tuple[float, ...]] = []

    def _drain_outbox(self) -> None:
        for message in self.stack.outbox:
            if isinstance(message, mailbox.Event):
                self.events.event(message)
        super()._drain_outbox()

    # ------------------------------------------------------------------ the truth
    def advance(self) -> None:
        sinking = -float(self.robot.truth["velocity_w"][0, 2])
        if self.frozen:
            self.robot.step()
        else:
            super().advance()
        x, y, z = self._true_position_w.tolist()
        wanted = self.stack.reference["position_w"][0].tolist()
        self._trace.append((self.robot.stamp_ns * 1e-9, x, y, z, *wanted))
        if z < TOUCHING and sinking > 0.02:
            self.hardest = max(self.hardest, sinking)
        self.most_tilted = max(self.most_tilted, self.tilt)

    @property
    def tilt(self) -> float:
        """Return the angle between the true z_B and z_W in rad."""
        _, a, b, _ = self._true_quaternion_wb.tolist()
        return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (a * a + b * b))))

    @property
    def height(self) -> float:
        """Return the true height in m."""
        return float(self._true_position_w[2])

    @property
    def airborne(self) -> bool:
        """Return whether the motors turn."""
        return bool(self.robot.rotor_speeds.max() > 25.0)

    def trace(self, since: float = 0.0) -> tuple[Array, Array, Array]:
        """Return times (N,) s, true and reference positions (N, 3) m, from `since` (s) on."""
        rows = np.array([row for row in self._trace if row[0] >= since])
        return rows[:, 0], rows[:, 1:4], rows[:, 4:7]

    def forget(self) -> None:
        """Reset the trace, the largest tilt and the hardest touch-down."""
        self._trace.clear()
        self.hardest = self.most_tilted = 0.0

    # ------------------------------------------------------------------ actions
    def hover(self, height: float = 1.0, settling: float = 3.0) -> Self:
        """Take off and settle. Raises RefusedError."""
        self.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
        self.wait(0.5)
        self.arm()
        self.wait(1.0)
        self.start("take_off", height=height)
        self.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=30)
        self.wait(settling)
        return self

    def run(self, seconds: float) -> None:
        """Run as `wait` does, but also while the flight process is stopped."""
        end_ns = self.robot.stamp_ns + round(seconds * 1e9)
        while self.robot.stamp_ns < end_ns:
            self.advance()

    def down(self, longest: float = 40.0) -> bool:
        """Continue until the motors are off; return whether it is then upright on the ground."""
        end_ns = self.robot.stamp_ns + round(longest * 1e9)
        while self.airborne and self.robot.stamp_ns < end_ns:
            self.advance()
        self.run(0.5)
        return self.height < 0.03 and math.degrees(self.tilt) < 5.0

    def disturb(self, **values: Any) -> None:
        """Change the simulated robot in flight: `payload`, `wind_x`, …"""
        self.parameters.simulator = self.parameters.simulator.model_copy(update=values)
        self.robot.configure(self.parameters.simulator)


class WatchedFlight(Observed):
    """A flight on full sensors: noisy, biased, 10-bit IMU and the tracker. No log is written.

    Args:
        seed: seed of all noise.
        settings: of vehicle, `simulator`, `tracker`, as `--set` accepts them.
        true_state: fly on the true state instead of an estimate.
        board: the vehicle's board, one of those that can be simulated.
        plugins: folder of users' control laws and estimators.
    """

    def __init__(
        self,
        seed: int = 1,
        settings: dict[str, ParameterValue] | None = None,
        *,
        true_state: bool = False,
        board: str = MIKROKOPTER,
        plugins: Path | None = None,
    ) -> None:
        offer_plugins(plugins)
        kind = find_kind(board)
        options = kind.configured({})
        parameters = with_groups(new_flight_parameters(), {"board": options})
        parameters.seed(seed)
        ParameterStore(parameters).preset(kind.simulated_parameters | (settings or {}))
        robot = SimulatedVehicle(parameters.simulator, firmware=firmware_of(board, options))
        estimator = TrueState(robot) if true_state else None
        super().__init__(parameters, robot, Events(), estimator, plugins, kind)
