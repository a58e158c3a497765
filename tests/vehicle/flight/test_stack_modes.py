"""Reactions to failures: the whole stack on the simulated vehicle, through real bytes."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import RefusedError
from quadrotor.motor_state import MotorState
from quadrotor.records import Record
from tests.support.lab import Lab
from tests.support.narrowing import now
from vehicle import mailbox
from vehicle.boards.board import RawSample
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.flight.stack import FlightStack
from vehicle.modes import ControlMode, Mode
from vehicle_link.serial.ids import FlightControlMode, Id


class FailingLab(Lab):
    """Flight in which parts can be made to fail."""

    frozen = False
    held: tuple[float, float, float, float] | None = None
    impact = 0.0

    def advance(self) -> None:
        speed = -float(self.robot.truth["velocity_w"][0, 2])
        if self.frozen:
            self.robot.step()
        else:
            if self.held is not None:
                self.stack.measure(mailbox.Joy(self.stack.stamp_ns, self.held, True))
            super().advance()
        if self.height < 0.005 and speed > 0.02:
            self.impact = max(self.impact, speed)

    @property
    def tilt(self) -> float:
        """Return the true tilt, degrees."""
        _, x, y, _ = self.robot.truth["quaternion_wb"][0]
        return math.degrees(2 * math.asin(min(1.0, math.hypot(x, y))))

    def emergency(self) -> mailbox.Reply:
        return self.stack.handle(mailbox.Emergency("1", "anna", "land"))

    def landed(self) -> None:
        """Wait until the motors are off; then the vehicle must be upright and undamaged."""
        self.wait_until(lambda v: not v.armed, what="disarmed", timeout=25)
        self.wait(0.5)
        assert self.height < 0.02
        assert self.tilt < 3.0
        assert 0.0 < self.impact < 0.8
        assert np.all(self.robot.rotor_speeds < 25.0)

    @property
    def control_told(self) -> ControlMode:
        """Return the control mode in the status."""
        return ControlMode(self.stack.status["control_mode"][0])


def test_a_program_outside_flies_and_is_braked_when_it_falls_silent() -> None:
    """Fly a circle of references, 50 a second, each 30 ms old on arrival.

    The texts of the events are checked too.
    """
    radius, omega, age = 0.5, 1.2, 0.03
    lab = FailingLab().hovering()
    start, begin = lab.stack.reference["position_w"][0].copy(), lab.stack.stamp_ns

    def send() -> None:
        stamp_ns = lab.stack.stamp_ns - round(age * 1e9)
        angle = omega * max(0.0, (stamp_ns - begin) * 1e-9)
        turned = np.array([math.cos(angle), math.sin(angle), 0.0])
        ahead = np.array([-math.sin(angle), math.cos(angle), 0.0])
        numbers = np.zeros(18)
        numbers[0:3] = start + radius * (turned - (1.0, 0.0, 0.0))
        if angle > 0.0:
            numbers[3:6], numbers[6:9] = radius * omega * ahead, -radius * omega**2 * turned
            numbers[9:12], numbers[12:15] = -radius * omega**3 * ahead, radius * omega**4 * turned
        lab.stack.measure(mailbox.ExternalReference(stamp_ns, tuple(numbers.tolist())))

    with pytest.raises(
        RefusedError, match="external refused: no reference was received on the topic"
    ):
        lab.start("external")
    send()
    lab.start("external")
    errors = []
    for tick in range(round(6.0 * 500)):
        if tick % 10 == 0:
            send()
        lab.advance()
        if tick > 1000:
            wanted, flown = lab.stack.reference["position_w"], lab.robot.truth["position_w"]
            errors.append(float(np.linalg.norm(wanted - flown)))
    assert lab.view().behavior == "external"
    assert max(errors) < 0.05
    lab.wait(0.4)
    assert lab.view().behavior == "brake"
    assert "braking: the newest reference of the topic external_reference is 0.20 s old" in (
        lab.said
    )
    lab.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=5)


@pytest.mark.parametrize("height", [1.0, 2.5])
def test_emergency_land_leaves_the_landing_to_the_microcontroller(height: float) -> None:
    lab = FailingLab().hovering(height)
    assert lab.emergency().accepted
    lab.advance()
    assert lab.stack.modes.control_mode is ControlMode.EMERGENCY
    assert lab.control_told is ControlMode.DIRECT, "the microcontroller has not answered yet"
    lab.wait(0.1)
    assert lab.robot.firmware.motor_state is MotorState.EMERGENCY
    assert now(lab).control_told is ControlMode.EMERGENCY
    lab.landed()
    assert "emergency land by anna; the microcontroller lands on its own" in lab.said
    assert "landed by the microcontroller" in lab.said
    lab.arm()
    lab.wait(0.5)
    assert now(lab).robot.firmware.motor_state is MotorState.ON, "and it flies again"


@pytest.mark.parametrize("chosen", ["land", "descend"])
def test_what_emergency_land_does_is_a_parameter(chosen: str) -> None:
    lab = FailingLab(settings={"safety.emergency_land": chosen}).hovering()
    assert lab.emergency().accepted
    lab.wait(0.3)
    modes = {"land": ControlMode.DIRECT, "descend": ControlMode.NEAR_HOVERING}
    assert lab.stack.modes.control_mode is modes[chosen]
    assert lab.robot.firmware.motor_state is MotorState.ON
    lab.landed()


@pytest.mark.parametrize(("chosen", "told"), [("emergency", "EMERGENCY"), ("land", "DIRECT")])
def test_emergency_land_takes_a_milder_landing_over(chosen: str, told: str) -> None:
    lab = FailingLab(settings={"safety.emergency_land": chosen}).hovering()
    lab.stack.modes.land("a test")
    lab.wait(0.1)
    assert lab.emergency().accepted
    lab.wait(0.1)
    assert lab.control_told is ControlMode[told]
    assert lab.stack.mode is Mode.EMERGENCY_LAND


def test_a_frozen_computer_is_landed_and_finds_itself_on_the_ground() -> None:
    lab = FailingLab().hovering(2.0)
    lab.frozen = True
    for _ in range(12 * 500):
        lab.advance()
    assert lab.robot.firmware.motor_state is MotorState.OFF
    assert lab.height < 0.02
    assert 0.0 < lab.impact < 0.8
    lab.frozen = False
    for _ in range(500):
        lab.advance()
    assert lab.stack.mode is Mode.READY
    assert "landed by the microcontroller" in lab.said


def test_a_computer_that_was_frozen_for_a_second_does_not_fight_the_landing() -> None:
    lab = FailingLab().hovering(2.0)
    lab.frozen = True
    for _ in range(500):
        lab.advance()
    lab.frozen = False
    lab.wait(0.1)
    assert lab.stack.mode is Mode.EMERGENCY_LAND
    assert "the microcontroller took over" in lab.said
    lab.landed()


def test_the_time_to_the_emergency_reaches_the_microcontroller() -> None:
    lab = FailingLab().hovering()
    assert lab.robot.firmware.registers[Id.EMERGENCY_TIMEOUT] == 250
    lab.change({"safety.command_timeout": 0.5})
    lab.wait(0.2)
    assert lab.robot.firmware.registers[Id.EMERGENCY_TIMEOUT] == 500


@pytest.mark.parametrize("height", [1.0, 2.9])
def test_a_lost_pose_is_a_descent_with_the_angles_held_by_the_microcontroller(
    height: float,
) -> None:
    lab = FailingLab().hovering(height)
    lab._tracker.parameters.drop_out = 1.0
    lab.wait_until(lambda v: v.mode == "emergency_land", what="descent", timeout=2.0)
    lab.wait(0.1)
    registers = lab.robot.firmware.registers
    assert registers[Id.FLIGHT_CONTROL_MODE] == FlightControlMode.NEAR_HOVERING
    lab.landed()
    assert "no pose measurement for 1.0 s; descending by the barometer" in lab.said


def test_an_estimate_that_diverged_is_not_flown_on() -> None:
    lab = FailingLab().hovering(1.5)
    lab.stack.estimate["position_innovation_w"] = 0.0
    step = lab.stack.navigation.step

    def lie(imu: Record, dt: float, state: Record, estimate: Record) -> None:
        step(imu, dt, state, estimate)
        lab.stack.estimate["position_innovation_w"][0, 0] = 2.0

    lab.stack.navigation.step = lie  # type: ignore[method-assign]
    lab.wait_until(lambda v: v.mode == "emergency_land", what="descent", timeout=1.0)
    assert "diverged: poses 2.00 m from their prediction" in lab.said
    lab.landed()


def test_a_gust_out_of_the_volume_lands_it() -> None:
    lab = FailingLab(settings={"safety.volume_margin": 0.2}).hovering()
    lab.change({"behavior.volume_x_max": 0.3})
    lab.robot.disturb((6.0, 0.0, 0.0))
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=5.0)
    assert "outside the flight volume" in lab.said
    lab.robot.disturb((0.0, 0.0, 0.0))
    lab.landed()


def test_a_keep_out_box_refuses_paths_holds_sticks_and_lands_what_enters_it() -> None:
    pillar = "pillar 0.7 1.2 -0.5 0.5 0.0 2.0"
    lab = FailingLab().ready()
    with pytest.raises(RefusedError, match=r"box lamp with its 0\.40 m is above the vehicle at"):
        lab.change({"behavior.keep_out": "lamp -1 1 -1 1 1.2 2"})
    lab.change({"behavior.keep_out": pillar})
    lab.hovering(0.6, settling=0.0, speed=1.0)
    with pytest.raises(RefusedError, match=r"is inside the keep-out box desk with its 0.40 m"):
        lab.change({"behavior.keep_out": "desk -1 0.1 -1 1 0 1"})
    with pytest.raises(RefusedError, match=r"x from 1 to 0 m; the first must be below"):
        lab.change({"behavior.keep_out": "desk 1 0 2 3 0 1"})
    assert lab.parameter("behavior.keep_out") == pillar
    with pytest.raises(RefusedError, match=r"within 0\.40 m of the keep-out box pillar"):
        lab.start("fly_to", x=2.0)
    assert lab.view().behavior == "hover"
    lab.held = (1.0, 0.0, 0.0, 0.0)
    lab.start("velocity")
    lab.wait(2.5)
    assert lab.robot.truth["position_w"][0, 0] == pytest.approx(0.3, abs=0.08)
    lab.start("near_hovering")  # knows no walls
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=3.0)
    assert "in the keep-out box pillar" in lab.said


def test_near_hovering_flies_by_angles_and_holds_its_altitude() -> None:
    lab = FailingLab().hovering(1.5)
    lab.held = (0.0, 0.0, 0.0, 0.0)
    lab.start("near_hovering")
    lab.wait(0.5)
    assert lab.stack.modes.control_mode is ControlMode.NEAR_HOVERING
    lab.held = (0.5, 0.0, 0.0, 0.0)
    lab.wait(0.8)
    w, x, y, z = lab.robot.truth["quaternion_wb"][0]
    assert math.degrees(math.asin(2 * (w * y - x * z))) == pytest.approx(6.0, abs=1.5)
    assert lab.robot.truth["velocity_w"][0, 0] > 0.4
    lab.held = None  # released
    lab.wait(0.8)
    assert lab.tilt < 2.0
    lab.start("hover")
    lab.wait(4.0)
    assert now(lab).stack.modes.control_mode is ControlMode.DIRECT
    assert np.abs(lab.robot.truth["velocity_w"][0]).max() < 0.05
    assert lab.height == pytest.approx(1.5, abs=0.4)


@pytest.mark.parametrize("leak", [15.0, -15.0])
def test_a_descent_by_a_barometer_that_leaks_goes_by_the_accelerometer(leak: float) -> None:
    lab = FailingLab().hovering(1.5)
    tick, begun_ns, highest = lab.stack.tick, lab.robot.stamp_ns, 0.0

    def leaking(sample: RawSample) -> object:
        pressure = sample.pressure + leak * max(0, sample.stamp_ns - begun_ns) * 1e-9
        return tick(msgspec.structs.replace(sample, pressure=pressure))

    lab.stack.tick = leaking  # type: ignore[method-assign, assignment]
    lab._tracker.parameters.drop_out = 1.0
    while lab.view().armed:
        lab.advance()
        highest = max(highest, lab.height)
        assert lab.robot.stamp_ns - begun_ns < 20e9
    assert "barometer and accelerometer disagree" in lab.said
    assert highest < 1.8  # it climbed at 0.8 m/s, without an end
    assert 0.0 < lab.impact < 0.6  # it was 2.3 m/s
    assert lab.height < 0.02


def test_near_hovering_out_of_the_volume_is_landed_while_the_pose_is_known() -> None:
    lab = FailingLab(settings={"safety.volume_margin": 0.1}).hovering(1.5)
    lab.held = (0.0, 0.0, 0.0, 0.0)
    lab.start("near_hovering")
    lab.change({"behavior.volume_x_max": 0.3})
    lab.held = (1.0, 0.0, 0.0, 0.0)
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=5.0)
    assert "outside the flight volume" in lab.said
    assert lab.stack.modes.control_mode is ControlMode.DIRECT
    lab.landed()


def test_without_altitude_hold_the_stick_is_thrust() -> None:
    lab = FailingLab().hovering(1.5)
    lab.held = (0.0, 0.0, 0.0, 0.0)
    lab.start("near_hovering", hold_altitude=False)
    lab.wait(0.3)
    lab.held = (0.0, 0.0, 0.5, 0.0)
    lab.wait(0.5)
    assert lab.robot.truth["velocity_w"][0, 2] > 0.4


def test_without_a_pose_only_what_needs_none_may_follow_near_hovering() -> None:
    lab = FailingLab().hovering(1.5)
    lab.held = (0.0, 0.0, 0.0, 0.0)
    lab.start("near_hovering")
    lab._tracker.parameters.drop_out = 1.0
    lab.wait(3.0)
    assert lab.view().behavior == "near_hovering", "a pilot needs no pose"
    with pytest.raises(RefusedError, match=r"no fresh pose .* near_hovering, emergency_landing"):
        lab.start("hover")
    lab.start("emergency_landing")
    lab.landed()


def test_the_supervisor_lands_when_a_serial_port_is_gone() -> None:
    lab = FailingLab().hovering()
    assert isinstance(lab._board, Microcontroller)
    lab._board._ports.lost = 1
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=1.0)
    assert "a serial port is lost" in lab.said
    lab.landed()


def test_the_gyroscope_is_not_calibrated_while_the_microcontroller_lands() -> None:
    lab = FailingLab().hovering(1.0)
    for _ in range(200):  # the flight process has died and was restarted
        lab.robot.step()
    assert lab.robot.firmware.motor_state is MotorState.EMERGENCY
    again = FlightStack(FlightParameters().model_copy(deep=True))
    mcu = Microcontroller(lab.robot.ports, epoch_ns=0)
    ready_at = None
    for _ in range(10 * 500):
        lab.robot.step()
        mcu.service(lab.robot.stamp_ns * 1e-9)
        for sample in mcu.receive():
            again.tick(sample)
        if ready_at is None and again.mode is Mode.READY:
            ready_at = lab.height
            assert now(lab).robot.firmware.motor_state is MotorState.OFF
    assert ready_at is not None
    assert ready_at < 0.01
    assert any(
        "started while the motors are running" in event.text
        for event in again.outbox
        if hasattr(event, "text")
    )
