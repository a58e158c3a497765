"""The simulated robot: plant, sensors and firmware, stepped together."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from quadrotor.errors import RefusedError
from quadrotor.motor_state import MotorState
from quadrotor.records import STATE, Record
from vehicle.simulator.battery import charge_battery
from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.faults.acting import ActingFaults
from vehicle.simulator.faults.truth import Truth
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.firmware.native import NativeFirmware
from vehicle.simulator.force_sensor import ForceReading, ForceSensor
from vehicle.simulator.held_vehicle import BENCH, FREE, configure_holder, new_holder
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.periods import Command, compile_periods, runner
from vehicle.simulator.plant import configure_plant, new_plant
from vehicle.simulator.sensors import SENSORS, WARM_UP_TIME, Noise, configure_sensors, sample
from vehicle.simulator.serial_faults import Line, configure_wires, new_wires
from vehicle_link.serial.ids import Id
from vehicle_link.serial.port import MemoryPort, memory_port_pair

PORTS = 2
_MIRROR_PERIOD = int(Id.MIRROR_PERIOD)

PERIOD_MAX_US = 1000
"""Longest period, in us, of the microcontroller's estimation and control, at any sample rate."""


class SimulatedVehicle:
    """The simulated robot; deterministic for its parameters and the bytes that it receives.

    Args:
        parameters: the truth.
        ports: its own ends of the serial lines; None creates them in memory.
        firmware: firmware of another board than the paper's.

    Raises StorageError when the C firmware cannot be built.

    Attributes:
        ports: the flight stack's ends, when created in memory; else empty.
        truth: STATE record, shape (1,), a live view: copy it to keep it.
        stamp_ns: time of `truth` since the first sample, on the microcontroller's clock.
        acting: the parameters as faults have moved them, `parameters` without faults.
    """

    def __init__(
        self,
        parameters: SimulatorParameters,
        ports: Sequence[Line] | None = None,
        firmware: BoardFirmware | None = None,
    ) -> None:
        self.ports: tuple[MemoryPort, ...] = ()
        if ports is None:
            pairs = [memory_port_pair() for _ in range(PORTS if firmware is None else 1)]
            self.ports = tuple(pair[0] for pair in pairs)
            ports = [pair[1] for pair in pairs]
        self.parameters = self.acting = parameters
        self.firmware = firmware or (
            NativeFirmware(len(ports)) if parameters.firmware == "c" else Firmware(len(ports))
        )
        self.stamp_ns = 0
        self._wires = new_wires(ports, parameters)
        self._commands: deque[tuple[int, Command]] = deque([(0, self.firmware.command)])
        self._plant = new_plant(parameters)
        self._blown_w = np.zeros(3)
        self._holder = new_holder()
        self._held = self._holder["held"]  # a view
        configure_holder(self._holder, self._plant, parameters)
        self._force_sensor = ForceSensor(parameters)
        self._noise, self._chance = Noise(parameters.seed), random.Random(parameters.seed)
        self._sensors = np.zeros(1, SENSORS)
        self._faults = ActingFaults({} if firmware is None else firmware.lacking)
        self._faults.set(parameters, 0)
        self._charged = parameters.battery_charge
        self._fit(parameters)
        world = self._plant, self._sensors, self._noise.block
        self._run = runner(self.firmware, world, self._holder)
        self._begun_ns = 0  # time of period 0
        self._count = 0  # periods begun, period 0 included
        if firmware is None:
            self.firmware.registers[Id.MIRROR_PERIOD] = round(1e6 / parameters.imu_rate)
        else:
            firmware.configure(parameters)
        self._pace()
        self._miss(parameters.missing_motor)
        self.truth: Record = self._plant["x"].view(STATE).reshape(1)
        self.truth["position_w"][0, :2] = parameters.start_x, parameters.start_y

    @property
    def battery_voltage(self) -> float:
        """Return the voltage at the terminals, V."""
        return float(self._plant["voltage"][0])

    @property
    def rotor_speeds(self) -> npt.NDArray[np.float64]:
        """Return (4,) counts of motor reference, motors front, left, rear, right; a live view."""
        speeds: npt.NDArray[np.float64] = self._plant["rotor_speeds"][0]
        return speeds

    def step(self) -> None:
        """Process the bytes that arrived, advance to the next sample and send it.

        The first call sends the sample at time 0 without moving.
        """
        self._obey()
        self._advance(self._periods - (self._count - 1) % self._periods if self._count else 1)

    def step_periods(self, most: int) -> None:
        """Step as `step` does, by at most `most` periods of the microcontroller.

        These include the first period. The step ends with the next sample at the latest.
        """
        self._obey()
        self._advance(self._at_once(most))

    def _at_once(self, most: int) -> int:
        left = self._periods - (self._count - 1) % self._periods
        return min(most, left) if self._count else 1

    def _pace(self) -> None:
        """Apply the requested sample rate; periods are counted from now on."""
        if self._count:
            self._begun_ns, self._count = self._time_ns(self._count - 1), 1
        self._sample_us = int(self.firmware.registers[_MIRROR_PERIOD])
        self._periods = math.ceil(self._sample_us / PERIOD_MAX_US)
        self._period = self._sample_us / (1e6 * self._periods)
        self.firmware.set_period(16 * self._sample_us // self._periods)

    def _time_ns(self, count: int) -> int:
        return self._begun_ns + count * self._sample_us * 1000 // self._periods

    def _obey(self) -> None:
        firmware = self.firmware
        for index, wire in enumerate(self._wires):
            data = wire.read()
            if data:
                replies = firmware.receive(index, data)
                if replies:
                    wire.write(replies)
        if firmware.registers.item(_MIRROR_PERIOD) != self._sample_us:
            self._pace()

    def _advance(self, periods: int) -> None:
        """Advance by this many periods, the last of which may send a sample."""
        firmware, noise, first = self.firmware, self._noise, not self._count
        command = self._acting()
        last = self._count + periods - 1
        self.stamp_ns = stamp_ns = self._time_ns(last)
        if self._faults:
            self._have_faults()
        if self._warms_up:
            self._sensors["warmth"] = -math.expm1(-1e-9 * stamp_ns / WARM_UP_TIME)
        firmware.advance(stamp_ns // 1_000_000)
        row = noise.next_rows(periods)
        if first:
            sample(self._plant, self._sensors, noise.block, row, firmware.registers)
            if isinstance(firmware, BoardFirmware):
                firmware.sense(self._plant, self._sensors, noise.block, row)
            firmware.period(command)
        else:
            self._run(row, command, periods, self._period)
            firmware.steps(stamp_ns // 1_000_000, periods, 1)
        self._count = last + 1
        if last % self._periods == 0:
            port_index, frame = firmware.next_data()
            if not (self._lost and self._chance.random() < self._lost):
                self._wires[port_index].write(frame)

    def _acting(self) -> Command:
        """Return the newest command that is at least as old as the latency."""
        commands, newest = self._commands, self.firmware.command
        if newest != commands[-1][1]:
            commands.append((self.stamp_ns, newest))
        old_ns = self.stamp_ns - self._latency_ns
        while len(commands) > 1 and commands[1][0] <= old_ns:
            commands.popleft()
        return commands[0][1]

    def due_ns(self, most: int = 1) -> int:
        """Return the time that `step_periods` would reach."""
        return self._time_ns(self._count + self._at_once(most) - 1)

    @property
    def period(self) -> float:
        """Return the microcontroller's period in s."""
        return self._period

    @property
    def sample_period_ns(self) -> int:
        """Return the sample period in ns, which the flight stack sets."""
        return 1000 * self._sample_us

    def skip(self, samples: int) -> None:
        """Advance the clock by this many samples that are never sent, without motion."""
        self._count += samples * self._periods

    def warm_up(self) -> None:
        """Compile the functions that `step` calls, so that the first call is fast; changes no
        state.
        """
        world = self._plant.copy(), self._sensors, np.zeros_like(self._noise.block)
        compile_periods(world, self._period, isinstance(self.firmware, BoardFirmware))
        world[0]["rotor_speeds"] = 1.0
        ForceSensor(self.parameters).read(0, world[0], self.parameters)

    @property
    def held(self) -> bool:
        """Return whether a hand or the bench holds the vehicle; setting it down takes a while."""
        return bool(self._held.item() != FREE)

    def bench_reading(self) -> ForceReading | None:
        """Return the force/torque reading of the last step; None if none was due on the bench."""
        if self._held.item() != BENCH:
            return None
        return self._force_sensor.read(self.stamp_ns, self._plant, self.parameters)

    def disturb(self, force_w: Sequence[float]) -> None:
        """Apply this force (N, world axes) to the vehicle from now on; zeros end it."""
        self._plant["disturbance_w"] = force_w

    def blow_on(self, force_w: Sequence[float]) -> None:
        """Add the force (N, world axes) of other vehicles' air from now on; zeros end it."""
        new_w = np.array(force_w)
        self._plant["disturbance_w"] += new_w - self._blown_w
        self._blown_w = new_w

    def configure(self, parameters: SimulatorParameters) -> None:
        """Set new true values in flight, a payload for instance.

        Motion is kept, and so is the charge unless its parameter changed.
        """
        self._faults.set(parameters, self.stamp_ns)
        self.parameters = parameters
        self._have_faults()

    def _have_faults(self) -> None:
        has_read = self._count > 0
        position_w = self.truth["position_w"][0]
        truth = self._faults.truth(self.parameters, self.stamp_ns, position_w, has_read)
        if truth is not None:
            self._apply(truth)

    def _apply(self, truth: Truth) -> None:
        """Set the true values of plant, sensors, lines and board."""
        self.acting = parameters = truth.parameters
        configure_plant(self._plant, parameters)
        self._plant["disturbance_w"] += self._blown_w
        if parameters.battery_charge != self._charged:
            self._charged = parameters.battery_charge
            self.charge_battery(self._charged)
        configure_holder(self._holder, self._plant, parameters)
        self._fit(parameters)
        truth.write(self._plant, self._sensors)
        self._miss(parameters.missing_motor)
        configure_wires(self._wires, parameters)
        if isinstance(self.firmware, BoardFirmware):
            self.firmware.configure(parameters)

    def charge_battery(self, share: float) -> None:
        """Set the battery's charge to a share (0..1) of its capacity, flying or not."""
        charge_battery(self._plant, share)

    def swap_battery(self) -> None:
        """Insert a full battery. Raises RefusedError unless the motors are off."""
        self._require_motors_off("battery not swapped")
        self.charge_battery(1.0)

    def reset(self) -> None:
        """Return the vehicle to its start, level and at rest, with a full battery.

        Raises RefusedError unless the motors are off and nothing holds the vehicle.
        """
        self._require_motors_off("vehicle not reset")
        if self.held:
            raise RefusedError(
                "vehicle not reset: a hand or the bench holds it; let it go first "
                "(simulator.held = free)"
            )
        self._plant["rotor_speeds"] = 0.0
        self.place((self.parameters.start_x, self.parameters.start_y, 0.0))
        self.charge_battery(1.0)

    def _require_motors_off(self, refused: str) -> None:
        state = self.firmware.motor_state
        if state in (MotorState.ON, MotorState.EMERGENCY):
            raise RefusedError(f"{refused}: the motors are on; land and disarm, or cut them, first")

    def _fit(self, parameters: SimulatorParameters) -> None:
        p = parameters
        configure_sensors(self._sensors, p)
        self._lost = p.lost_samples
        self._latency_ns = round(1e9 * p.command_latency)
        self._warms_up = p.accelerometer_warm_up != 0.0 or p.gyroscope_warm_up != 0.0

    def _miss(self, motor: int) -> None:
        self.firmware.set_missing(1 << motor - 1 if motor else 0)

    def place(
        self, position_w: Sequence[float], quaternion_wb: Sequence[float] = (1.0, 0.0, 0.0, 0.0)
    ) -> None:
        """Place the vehicle at this pose, at rest, to start away from the origin."""
        self.truth["position_w"] = position_w
        self.truth["velocity_w"] = 0.0
        self.truth["quaternion_wb"] = quaternion_wb
        self.truth["angular_velocity_b"] = 0.0

    def close(self) -> None:
        """End the process of its board, if it has one."""
        if isinstance(self.firmware, BoardFirmware):
            self.firmware.close()
