"""The parts of the flight stack, the record they fill, what others read of them."""

from __future__ import annotations

import math

import numpy as np

from bearing_sim.beacons import parse_layout
from control.behaviors.machine import BehaviorMachine
from control.controller import Controller
from estimation.estimator import Estimator
from quadrotor.parameters import ParameterStore
from quadrotor.records import ACTUATORS, Record, new_tick
from vehicle.calibration.gyroscope import GyroCalibration
from vehicle.calibration.imu import ImuCalibrator
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.flight.control_law import Steering
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.modes import ControlMode, Mode
from vehicle.flight.motor_bench import Bench
from vehicle.flight.near_hovering import NearHovering
from vehicle.flight.reference_rounding import ReferenceRounding
from vehicle.flight.status_writer import StatusWriter
from vehicle.parameters import VehicleParameters
from vehicle.processes import mailbox
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.supervisor import Situation, Supervisor
from vehicle_link.serial.ids import MotorState


class StackParts:
    """Made once, before the first tick.

    Args:
        parameters: the vehicle's tree.
        estimator, controller: plugins; defaults are those that the parameters name.

    Attributes:
        record: TICK (1,); imu, state, reference, actuators, estimate and status are its fields.
        outbox: what others are to be told, taken by the caller between ticks.
        lost_ports: of the microcontroller, told by the caller; so is
        obstacle: why it would not start the motors, empty when it would.
        guard: made by the whole, whose commands it gives.
    """

    guard: BearingsGuard

    def __init__(
        self,
        parameters: VehicleParameters,
        estimator: Estimator | None = None,
        controller: Controller | None = None,
    ) -> None:
        self.parameters = parameters
        self.store = ParameterStore(parameters)
        self.steering = Steering(parameters.control, parameters.model, controller)
        self.mass = FlownMass(parameters.mass, parameters.model.mass)
        self.behaviors = BehaviorMachine(parameters.behavior)
        self.supervisor = Supervisor(parameters.safety)
        self.imu_calibrator = ImuCalibrator(parameters.imu)
        self.record: Record = new_tick()
        self.imu = self.record["imu"]
        self.state = self.record["state"]
        self.reference = self.record["reference"]
        self.actuators = self.record["actuators"]
        self.estimate = self.record["estimate"]
        self.status = self.record["status"]
        self.mode = Mode.STARTING
        self.control_mode = self._told_control_mode = ControlMode.DIRECT
        self.lost_ports = 0
        self.obstacle = ""
        self.near_hovering = NearHovering(parameters.near_hovering)
        self.ground = GroundContact()
        self.outbox: list[mailbox.Told] = []
        self._stamp_ns = 0
        self._layout = parameters.beacons.layout
        self.navigation = Navigation(
            parameters.estimation,
            self.say,
            estimator,
            parse_layout(self._layout),
            parameters.fallback,
        )
        self.motor_state_wanted = MotorState.OFF
        self.bench = Bench(parameters.safety)
        self._gyro: GyroCalibration | None = None
        self._gyro_begun_ns = 0
        self._asked: mailbox.CalibrateGyroscope | None = None  # None: it is the start
        self._told_motors = False  # that they run while the gyroscope is to be calibrated
        self._off = np.zeros(1, ACTUATORS)
        self._off["scaling"] = 1.0
        self._rounding = ReferenceRounding()
        self._status_writer = StatusWriter(self.status)
        # Views made once: looking a field up by name in each tick costs as much as the laws.
        self._wanted_references = self.actuators["motor_references"][0]
        self._specific_force = self.imu["specific_force_b"][0]
        self._wrench = self.actuators["wrench"][0]
        self._scaling = self.actuators["scaling"]
        self._quaternion_wb = self.state["quaternion_wb"][0]
        self._sequence = self.record["sequence"]
        self._position = self.state["position_w"][0]
        self._velocity = self.state["velocity_w"][0]
        self._innovation = self.estimate["position_innovation_w"][0]
        self._agreement = self.estimate["agreement"]
        self._situation = Situation()
        self._joy: tuple[int, tuple[float, float, float, float], bool] | None = None
        self._armed_ns = 0

    def say(self, text: str, level: int = mailbox.INFO) -> None:
        """Put one line into the log and on the page."""
        self.outbox.append(mailbox.Event(stamp_ns=self._stamp_ns, level=level, text=text))

    @property
    def airborne(self) -> bool:
        """Return whether the vehicle is between take-off and touch-down."""
        return self.ground.airborne

    @property
    def stamp_ns(self) -> int:
        """Return time of the newest tick, ns of the vehicle's clock."""
        return self._stamp_ns

    @property
    def estimator(self) -> Estimator:
        """Return the estimator that is flown on."""
        return self.navigation.active

    @property
    def controller(self) -> Controller:
        """Return the controller that is flown with."""
        return self.steering.controller

    @property
    def has_pose(self) -> bool:
        """Return whether the pose measurement is present and fresh."""
        return not self.estimator.stale

    @property
    def tilt(self) -> float:
        """Return angle (rad) between z_B and z_W."""
        _, x, y, _ = self._quaternion_wb.tolist()
        return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
