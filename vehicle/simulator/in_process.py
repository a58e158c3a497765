"""A simulated vehicle inside the flight process, for rates beyond those of serial ports.

It has a plant, a microcontroller and its own tracking system, and exchanges bytes through memory.
It is computed between two ticks, before the next sample is due.
"""

from __future__ import annotations

from collections.abc import Callable

from bearing_sim.tracker import SimulatedTracker, TrackerParameters
from quadrotor.records import Record, pose_sample
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

Measure = Callable[[Record], None]


class InProcessRobot:
    """A plant, microcontroller and tracker, already compiled.

    Args:
        rate: samples a second.
        measure: called with each pose.

    Attributes:
        ports: the flight stack's ends of the lines.
        epoch_ns: the vehicle's time of the first sample, to be set before it.
    """

    def __init__(self, rate: int, measure: Measure) -> None:
        self.simulated = SimulatedVehicle(SimulatorParameters(imu_rate=rate))
        self.simulated.warm_up()
        self.ports = self.simulated.ports
        self.epoch_ns = 0
        self._measure = measure
        self._tracker = SimulatedTracker(TrackerParameters())
        truth = self.simulated.truth
        self._position_w, self._quaternion_wb = truth["position_w"][0], truth["quaternion_wb"][0]

    @property
    def stamp_ns(self) -> int:
        """Return the stamp of the newest sample in ns, since the first."""
        return self.simulated.stamp_ns

    def step(self) -> None:
        """Process commands, step to the next sample and send it; pass on the poses due."""
        self.simulated.step()
        now_ns = self.simulated.stamp_ns
        self._tracker.observe(now_ns, self._position_w, self._quaternion_wb)
        for pose in self._tracker.due(now_ns):
            stamp_ns = self.epoch_ns + pose.stamp_ns
            self._measure(pose_sample(stamp_ns, pose.position_w, pose.quaternion_wb))

    def skip(self, samples: int) -> None:
        self.simulated.skip(samples)
