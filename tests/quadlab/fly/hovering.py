"""A vehicle that hovers in simulated time, for what happens then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters, with_groups
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.boards.kind import find_kind
from vehicle.simulator.boards import firmware_of
from vehicle.simulator.simulated_vehicle import SimulatedVehicle


class Hovering:
    """Vehicle with this board, with these options of it, in the air at 1 m."""

    ALONE = 22.0
    """Time, s, within which the board has landed and stopped its motors."""

    def __init__(self, folder: Path, board: str, **options_set: ParameterValue) -> None:
        kind = find_kind(board)
        options = kind.configured(options_set)
        parameters = with_groups(FlightParameters().model_copy(deep=True), {"board": options})
        store = ParameterStore(parameters)
        store.preset(kind.simulated_parameters | {"behavior.volume_z_max": 3.5})
        self.vehicle = SimulatedVehicle(parameters.simulator, firmware=firmware_of(board, options))
        self.log = FlightLog(folder / "hover.mcap", "quad1", store, {})
        self.flight = flight = SimulatedFlight(parameters, self.vehicle, self.log, kind=kind)
        flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
        flight.wait(0.5)
        flight.arm()
        flight.wait(1.0)
        flight.start("take_off", height=1.0, speed=1.0)
        flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)

    @property
    def height(self) -> float:
        return float(self.vehicle.truth["position_w"][0, 2])

    def fly_to(self, height: float) -> None:
        self.flight.start("fly_to", x=0.0, y=0.0, z=height, yaw=0.0)
        self.flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=30)
        self.flight.wait(1.0)

    def left_alone(self) -> float:
        """Run board and plant without the flight stack; return the fastest descent in m/s."""
        return self.until_landed(self.vehicle.step, lambda: not any(self.motors))

    @property
    def motors(self) -> Sequence[float]:
        """Return the references of the motors."""
        return self.vehicle.firmware.references

    def until_landed(self, advance: Callable[[], object], is_done: Callable[[], bool]) -> float:
        """Continue until it has landed and `is_done`; return the fastest descent in m/s."""
        fastest = 0.0
        for _ in range(round(1000 * self.ALONE)):
            advance()
            fastest = max(fastest, -float(self.vehicle.truth["velocity_w"][0, 2]))
            if self.height < 0.02 and is_done():
                return fastest
        raise AssertionError(f"{self.height:.2f} m high after {self.ALONE} s, motors {self.motors}")
