"""One vehicle of the simulator process: plant, serial devices and the publisher of its truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from quadrotor.plain_rotations import Array
from vehicle.simulator.attendant import Attendant
from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.live_parameters import LiveParameters
from vehicle.simulator.lockstep import LockstepPace
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.pseudo_terminal import PseudoTerminal, ServedPort
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.simulator.tracking_systems.faults import TrackingFaults
from vehicle.simulator.truth import TruthPublisher, connect_to_station
from vehicle.simulator.uart import Uart
from vehicle_link.transport.loopback import SharedSession

SECOND_NS = 1_000_000_000


@dataclass(slots=True)
class RunStatistics:
    """The statistics of a run."""

    periods: int = 0  # of the microcontroller
    lost_samples: int = 0  # while the machine was suspended
    dropped_bytes: int = 0  # without a reader
    overruns: int = 0  # bytes beyond the capacity of the wire
    dropped_truth: int = 0  # the network was too slow


@dataclass(frozen=True, slots=True)
class Pace:
    """The pace of a simulation.

    Attributes:
        periods: number of the microcontroller's periods per step.
        truth_rate: Hz.
    """

    periods: int
    truth_rate: int


ALONE = Pace(1, 100)
"""Pace for one vehicle, in lockstep too: when woken only once per sample, up to half of the ticks
were a period late with the page open."""
SOME, MANY = Pace(5, 30), Pace(9, 15)
"""Paces for several on one processor: commands take up to 4 or 8 ms longer to the motors."""
FEW = 3
"""Largest number of vehicles that step at the pace `SOME`."""


def pace_of(count: int) -> Pace:
    """Return the pace of each of `count` vehicles."""
    return ALONE if count == 1 else SOME if count <= FEW else MANY


class Served(Protocol):
    """Tracking systems, which measure the vehicles and serve their measurements."""

    def offer(self, vehicle: str, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Measure this true pose: (3,) m, (4,) unit; it is copied."""

    def set_faults(self, vehicle: str, faults: TrackingFaults) -> None:
        """Set the faults from now on."""

    def close(self) -> None: ...


class Robot:
    """One vehicle: its plant, its serial devices and the publisher of its truth."""

    def __init__(
        self,
        name: str,
        parameters: SimulatorParameters,
        folder: Path,
        session: SharedSession | None,
        pace: Pace,
        lockstep: LockstepPace | None = None,
        served: Served | None = None,
        firmware: BoardFirmware | None = None,
    ) -> None:
        self._pace, self._served = pace, served
        self._name = name
        self._publisher: TruthPublisher | None = None
        self._terminals: list[ServedPort] = []
        self._lines: list[Uart] = []
        self._epoch_ns = self._start_ns = self._truth_due_ns = 0
        self._firmware = firmware
        try:
            for index in (0, 1) if firmware is None else (0,):
                link = folder / f"mcu{index}"
                if firmware is not None:  # its bytes are sent without the delay of a line
                    self._terminals.append(firmware.open_port(link))
                    continue
                terminal = PseudoTerminal(link)
                self._terminals.append(terminal)
                self._lines.append(Uart(terminal))
        except BaseException:
            self.close()
            raise
        if lockstep is not None and firmware is None:
            for line, awaited in zip(self._lines, lockstep.lines[name], strict=True):
                line.delivered = awaited.delivered
        self._simulated = SimulatedVehicle(parameters, self._lines or self._terminals, firmware)
        self._simulated.warm_up()
        self._live = LiveParameters(parameters, None if firmware is None else firmware.lacking)
        self._attendant = Attendant()
        self._served_as = self._simulated.acting
        if session is not None:
            connect = connect_to_station(session, name, self._live, self._attendant)
            self._publisher = TruthPublisher(connect, name)

    @property
    def place(self) -> str:
        return " and ".join(str(terminal.link) for terminal in self._terminals)

    @property
    def due_ns(self) -> int:
        """Return when to call `step` next, in ns of the steady clock."""
        return self._start_ns + self._simulated.due_ns(self._pace.periods)

    def begin(self, epoch_ns: int, start_ns: int) -> None:
        """Begin at the present time of the epoch's clock and of the steady clock."""
        self._epoch_ns, self._start_ns = epoch_ns, start_ns

    def lose(self, behind_ns: int) -> int:
        """Skip this much time and return the number of samples lost."""
        lost = behind_ns // self._simulated.sample_period_ns
        self._simulated.skip(lost)
        return lost

    def step(self) -> None:
        simulated = self._simulated
        changed = self._live.pop_changed()
        if changed is not None:
            simulated.configure(changed)
        charge = self._live.pop_charge()
        if charge is not None:
            simulated.charge_battery(charge)
        self._attendant.attend(simulated)
        duration = 1e-9 * (simulated.due_ns(self._pace.periods) - simulated.stamp_ns)
        for line in self._lines:
            line.advance(duration)
        simulated.step_periods(self._pace.periods)
        if self._served is not None and simulated.acting is not self._served_as:
            self._served_as = simulated.acting
            self._served.set_faults(self._name, simulated.acting.served)
        if self._publisher is not None:
            reading = simulated.bench_reading()
            if reading is not None:
                self._publisher.offer_reading(self._epoch_ns + reading.stamp_ns, reading)
        if simulated.stamp_ns >= self._truth_due_ns:
            self._truth_due_ns = simulated.stamp_ns + SECOND_NS // self._pace.truth_rate
            stamp_ns, truth = self._epoch_ns + simulated.stamp_ns, simulated.truth
            if self._publisher is not None:
                self._publisher.offer(stamp_ns, truth)
            if self._served is not None:
                pose = truth["position_w"][0], truth["quaternion_wb"][0]
                self._served.offer(self._name, stamp_ns, *pose)

    def add_to(self, statistics: RunStatistics) -> None:
        statistics.dropped_bytes += sum(terminal.dropped for terminal in self._terminals)
        statistics.overruns += sum(line.overruns for line in self._lines)
        if self._publisher is not None:
            statistics.dropped_truth += self._publisher.dropped

    def close(self) -> None:
        if self._publisher is not None:
            self._publisher.close()
        if self._firmware is not None:
            self._firmware.close()
        for terminal in self._terminals:
            terminal.close()
