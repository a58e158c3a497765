"""The supervisor's inputs in a tick, collected from the parts of the flight stack."""

from __future__ import annotations

from dataclasses import dataclass, field

from control.behaviors.parameters import BehaviorParameters
from estimation.outcome import Agreement
from quadrotor.compiled import direct
from vehicle.boards.board import RawSample
from vehicle.estimators.tracker_integrity import TrackerIntegrity
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.tick_record import TickRecord
from vehicle.modes import DIRECT
from vehicle.safety.excursion import excursion
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.supervisor import Situation

_JUMPED = int(Agreement.JUMPED)


@dataclass(kw_only=True, eq=False)
class SituationReader:
    """Collector of one Situation per tick.

    Args:
        volume: flight volume and keep-out boxes, read in each tick.
    """

    volume: BehaviorParameters
    tick: TickRecord
    modes: ModeMachine
    ground: GroundContact
    integrity: TrackerIntegrity
    _situation: Situation = field(default_factory=Situation)

    def __post_init__(self) -> None:
        walls = 0.0, 0.0, 0.0, 0.0, 0.0
        self._excursion = direct(excursion, self.tick.state, self.tick.estimate, walls)

    def read(self, sample: RawSample, pose_age: float) -> Situation:
        """Return the situation of this tick; it is valid until the next call.

        Args:
            pose_age: s since the newest measurement that was used in time.
        """
        now, tick, p, boxes = self._situation, self.tick, self.volume, self.volume.boxes
        now.airborne = self.ground.airborne
        now.by_microcontroller = self.modes.control_mode is not DIRECT
        now.voltage, now.pose_age = sample.battery_voltage, pose_age
        now.jumped = tick.agreement.item() == _JUMPED
        walls = p.volume_x_min, p.volume_x_max, p.volume_y_min, p.volume_y_max, p.volume_z_max
        found = self._excursion(tick.state, tick.estimate, walls)
        now.tilt, now.speed, now.innovation, now.outside = found
        now.box = ""
        if boxes:
            x, y, z = tick.position_w.tolist()
            near = [box for box in boxes if box.gap((x, y, z)) < 0.5 * p.keep_out_margin]
            now.box = near[0].name if near else ""
        now.saturated = tick.saturated
        now.inertial = self.integrity.suspicion
        now.lost_ports = self.modes.lost_ports
        return now
