"""Faults of the barometer and of the battery and its meter."""

from __future__ import annotations

from bearing_sim.faults.fault import Memory
from bearing_sim.faults.schedule import Moment
from quadrotor.parameters import parameter
from vehicle.simulator.faults.truth import BATTERY, PRESSURE, Truth, VehicleFault


class Ramp(VehicleFault):
    """The pressure read changes at a constant rate, as of a leaking port or changing weather."""

    name = "barometer.ramp"
    source = "definition; 11.6 Pa are 1 m of height"
    varies = True

    rate: float = parameter(5.0, unit="Pa/s", ge=-500, le=500, step=1)
    """rate; above 0 the vehicle seems to sink"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.parameters.ground_pressure += self.rate * moment.level * moment.elapsed


class Step(VehicleFault):
    """The pressure read is off by a constant, as when a door opens."""

    name = "barometer.step"
    source = "definition; 11.6 Pa are 1 m of height"

    pressure: float = parameter(20.0, unit="Pa", ge=-5000, le=5000, step=5)
    """read minus true pressure"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.parameters.ground_pressure += self.pressure * moment.level


class StuckBarometer(VehicleFault):
    """The barometer keeps its last reading, as of a blocked port."""

    name = "barometer.stuck"
    source = "definition"

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.stuck.add(PRESSURE)


class StuckBattery(VehicleFault):
    """The battery's meter keeps its last reading, while the battery drains."""

    name = "battery.stuck"
    source = "definition"

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.stuck.add(BATTERY)


class Sag(VehicleFault):
    """The inner resistance grows, as of a cold or worn pack: the voltage falls with the current."""

    name = "battery.sag"
    source = "U = U0 - R I, Ohm's law of a cell with an inner resistance"

    resistance: float = parameter(0.1, unit="ohm", ge=0.0, le=0.3, step=0.01)
    """resistance on top of simulator.battery_resistance"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.parameters.battery_resistance += self.resistance * moment.level


SUPPLY: tuple[type[VehicleFault], ...] = (Ramp, Step, StuckBarometer, StuckBattery, Sag)
