"""The board with a Crazyflie, against the simulated one, millisecond by millisecond."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from extensions.crazyflie.board.board import FALLS, TWO
from extensions.crazyflie.board.firmware_parameters import describe
from extensions.crazyflie.board.messages import MANUAL, SETPOINT, WRITE
from extensions.crazyflie.board.options import CrazyflieOptions
from extensions.crazyflie.crtp.packets import CrtpPort, Packet, frame
from extensions.crazyflie.tests.board.bench import Bench
from quadrotor.errors import OutOfBoundsError
from quadrotor.motor_state import MotorState
from quadrotor.parameters import ParameterStore
from quadrotor.records import STATE
from vehicle.boards.board import BodyRates, TakesPoses
from vehicle.boards.offered import FIRMWARE, offer
from vehicle.parameters import VehicleParameters, new_parameters
from vehicle_link.serial.attitude_command import AttitudeCommand

HOVER = BodyRates((0.0, 0.0, 0.0), 0.0, 0.24)
READY_MS = 800


def ready(**kwargs: object) -> Bench:
    bench = Bench(**kwargs)  # type: ignore[arg-type]
    bench.go(READY_MS)
    assert bench.board.obstacle == ""
    assert bench.board.failures == [FALLS]  # told before it can be armed
    bench.board.failures.clear()
    return bench


def armed() -> Bench:
    bench = ready()
    bench.board.set_motor_state(MotorState.ON)
    bench.go(200)
    assert bench.board.state is MotorState.ON
    return bench


def setpoints(bench: Bench) -> list[tuple[float, ...]]:
    """Return the manual set-points that arrived: roll, pitch, yaw rate, thrust, is rate."""
    of = [p.data for p in bench.firmware.taken if p.port == 7 and p.data[:1] == bytes((MANUAL,))]
    return [SETPOINT.unpack(data)[1:] for data in of]


def test_samples_come_at_100_hz_with_their_own_times_in_spite_of_delay() -> None:
    bench = ready()
    samples = bench.go(1000)
    assert len(samples) == 100
    assert {b.stamp_ns - a.stamp_ns for a, b in itertools.pairwise(samples)} == {10_000_000}
    newest = samples[-1]
    assert newest.accelerometer == (0, 0, 1365)  # 1 g by 24 g of 32768 counts
    assert [newest.battery_voltage, newest.pressure] == pytest.approx([4.1, 96000.0])
    age_ms = bench.now_ms - 1e-6 * newest.stamp_ns
    assert 0.0 <= age_ms - 4.0 <= 10.0


def test_a_lost_packet_costs_its_sample_and_no_more() -> None:
    bench = ready(loss=0.05)
    samples = bench.go(4000)
    assert 360 < len(samples) < 399
    assert {(b.stamp_ns - a.stamp_ns) % 10_000_000 for a, b in itertools.pairwise(samples)} == {0}
    assert bench.board.failures == []


def test_rates_and_angles_go_up_in_the_signs_of_the_crazyflie() -> None:
    bench = armed()
    bench.board.command(BodyRates((0.1, 0.2, 0.3), 0.0, 0.24))
    bench.board.command(AttitudeCommand(0.1, 0.2, 0.3, 0.0, 0.48))
    bench.go(10)
    degrees = [math.degrees(0.1), -math.degrees(0.2), math.degrees(0.3)]
    rates, angles = setpoints(bench)[-2:]
    assert rates == pytest.approx((*degrees, 32768, 1), rel=1e-6)
    assert angles == pytest.approx((*degrees, 65535, 0), rel=1e-6)


def test_a_command_is_never_repeated_so_that_the_watchdog_sees_the_end_of_the_ticks() -> None:
    bench = armed()
    bench.board.command(HOVER)
    bench.go(600)
    assert len(setpoints(bench)) == 2  # the first one armed it
    assert bench.firmware.supervisor.levels_out


def test_one_that_flies_on_when_it_must_not_is_stopped_for_good() -> None:
    bench = armed()
    bench.board.command(HOVER)
    bench.go(50)
    bench.firmware.supervisor.arm = lambda on: False  # type: ignore[method-assign]
    bench.board.set_motor_state(MotorState.OFF)
    bench.go(400)
    assert not bench.firmware.supervisor.locked
    bench.go(300)
    assert bench.firmware.supervisor.locked


def test_a_pose_becomes_its_own_estimate_and_a_wrong_one_blocks_arming() -> None:
    bench = ready()
    assert isinstance(bench.board, TakesPoses)
    state = np.zeros(1, STATE)
    state["quaternion_wb"][0, 0], state["position_w"] = 1.0, (1.0, 2.0, 0.0)
    bench.board.locate(state, 1e-3 * bench.now_ms)
    bench.go(10)
    bench.board.locate(state, 1e-3 * bench.now_ms)
    assert bench.board.obstacle.startswith("its own estimate is 2.2 m from ours: wait, or check")
    bench.go(300, lambda: bench.board.locate(state, 1e-3 * bench.now_ms))
    assert bench.board.obstacle == ""
    poses = [packet for packet in bench.firmware.taken if packet.port == 6]
    assert len(poses) == pytest.approx(16, abs=1)  # 50 a second


def test_off_stops_the_motors_at_once_and_disarms() -> None:
    bench = armed()
    bench.board.command(HOVER)
    bench.go(50)
    assert any(bench.firmware.references)
    bench.board.set_motor_state(MotorState.OFF)
    bench.go(7)
    assert not any(bench.firmware.references)
    bench.go(200)
    assert not bench.firmware.supervisor.armed
    assert bench.board.state is MotorState.OFF


def test_given_up_it_descends_level_and_then_stops() -> None:
    bench = Bench(CrazyflieOptions(landing_time=1.0, landing_thrust=0.24))
    bench.go(READY_MS)
    bench.board.set_motor_state(MotorState.ON)
    bench.go(200)
    bench.board.command(HOVER)
    bench.go(50)
    bench.board.set_motor_state(MotorState.EMERGENCY)
    bench.board.command(BodyRates((1.0, -1.0, 0.5), 0.0, 0.4))  # from the tick that decided it
    bench.go(10)
    bench.firmware.taken.clear()
    assert bench.go(100)[-1].motor_state is MotorState.EMERGENCY
    assert set(setpoints(bench)) == {(0.0, 0.0, 0.0, 32768, 0)}
    bench.go(1200)
    assert bench.board.state is MotorState.OFF


@pytest.mark.parametrize(
    ("silent_ms", "levels", "turns"), [(300, False, True), (1200, True, True), (2300, False, False)]
)
def test_without_set_points_it_levels_out_then_stops_and_locks(
    silent_ms: int, levels: bool, turns: bool
) -> None:
    bench = armed()
    bench.board.command(BodyRates((0.2, 0.0, 0.0), 0.0, 0.24))
    bench.go(50)
    firmware = bench.firmware
    for _ in range(silent_ms):
        firmware.period((0, 0, 0, 0))
    assert firmware.supervisor.levels_out is levels
    assert any(firmware.references) is turns
    assert firmware.supervisor.locked is not turns


def test_one_out_of_reach_goes_on_and_one_switched_off_is_met_again() -> None:
    bench = ready()
    known = bench.board.found
    for _ in range(3000):
        bench.now_ms += 1
        bench.board.service(1e-3 * bench.now_ms)
        bench.far.read()
        bench.firmware.period((0, 0, 0, 0))
        bench.firmware.next_data()
    bench.go(300)
    assert bench.board.found is known
    again = Bench()
    bench.firmware = again.firmware
    bench.go(2500)
    assert bench.board.found is not known
    assert bench.board.obstacle == ""
    assert bench.firmware.parameters.values["stabilizer.estimator"] == 2


def test_two_at_one_address_are_told_once_and_not_armed() -> None:
    bench = ready()
    second = Bench()
    second.go(READY_MS + 437)  # switched on earlier

    def answer() -> None:
        sent = b"".join(map(frame, map(Packet.encode, bench.firmware.taken)))
        bench.firmware.taken.clear()
        second.firmware.receive(0, sent)
        second.firmware.period((0, 0, 0, 0))
        bench.far.write(second.firmware.next_data()[1])

    bench.go(6000, answer)
    assert bench.board.failures == [TWO]
    bench.board.set_motor_state(MotorState.ON)
    bench.go(300, answer)
    assert bench.board.obstacle == TWO
    assert not bench.firmware.supervisor.armed
    bench.go(6000)  # one was switched off
    assert bench.board.obstacle == ""


def test_its_console_is_told() -> None:
    bench = ready()
    bench.firmware._send(Packet(0, 0, b"SYS: low"))
    bench.firmware._send(Packet(0, 0, b" battery\nnext"))
    bench.go(10)
    assert bench.board.failures == ["Crazyflie: SYS: low battery"]


@pytest.mark.parametrize(
    ("options", "protocol", "why"),
    [
        ({}, 8, "the Crazyflie speaks CRTP 8, older than 12, the version that was tried"),
        ({}, 14, "the Crazyflie speaks CRTP 14, newer than 12"),
        (
            {"parameters": "stabilizer.controler=1"},
            None,
            "the Crazyflie has no parameter stabilizer.controler; did you mean "
            "stabilizer.controller or stabilizer.estimator?",
        ),
        ({"parameters": "cpu.flash"}, None, "cpu.flash of the Crazyflie is read-only"),
        ({"parameters": "pid_rat.*"}, None, "no parameter pid_rat.*; did you mean pid_rate."),
        ({"parameters": "motion.disable=1"}, None, "no parameter motion.disable; it has 20 others"),
        ({"parameters": "stabilizer.estimator=900"}, None, "stabilizer.estimator cannot be 900"),
    ],
)
def test_one_that_does_not_fit_says_so_once_and_never_arms(
    options: dict[str, str], protocol: int | None, why: str
) -> None:
    bench = Bench(CrazyflieOptions(**options), protocol=protocol)  # type: ignore[arg-type]
    bench.board.set_motor_state(MotorState.ON)
    bench.go(2500)
    [line] = bench.board.failures
    assert why in line
    assert bench.board.obstacle == line
    assert not bench.firmware.supervisor.armed


def test_what_it_cannot_take_is_refused() -> None:
    with pytest.raises(OutOfBoundsError, match="board crazyflie takes body rates and collective"):
        Bench().board.command((60, 60, 60, 60))
    with pytest.raises(OutOfBoundsError, match=r"board\.parameters has 'stabilizer'; give GROUP"):
        Bench(CrazyflieOptions(parameters="stabilizer"))


def test_changed_parameters_are_set_and_read_back_while_set_points_go_on() -> None:
    options = CrazyflieOptions()
    bench = Bench(options)
    bench.go(2000)
    assert bench.board.obstacle == ""
    bench.board.failures.clear()
    bench.firmware.taken.clear()
    options.parameters = "stabilizer.estimator=2; pid_attitude.roll_kp=7.5"
    bench.go(300)
    before, after = 6.0, bench.firmware.parameters.values["pid_attitude.roll_kp"]
    assert after == 7.5
    assert bench.board.failures == [
        f"the Crazyflie has set pid_attitude.roll_kp to 7.5, it was {before:g}"
    ]
    assert bench.board.obstacle == ""
    assert sum(packet.port == CrtpPort.SETPOINT for packet in bench.firmware.taken) >= 5


def shown(parameters: str, **kwargs: object) -> tuple[Bench, VehicleParameters]:
    """Return a bench whose Crazyflie was checked, and the parameters of its vehicle."""
    options = CrazyflieOptions(parameters=parameters)
    checked = Bench(options, is_passive=True)
    checked.go(READY_MS)
    options.firmware = describe(checked.board.found.named, options.wanted)
    offer(options, live=True)
    tree = new_parameters()
    offer(None, live=False)
    assert isinstance(tree.board, CrazyflieOptions)
    bench = Bench(tree.board)
    bench.go(READY_MS)
    bench.board.failures.clear()
    bench.firmware.taken.clear()
    return bench, tree


def test_parameters_of_its_table_are_the_vehicles_with_the_range_of_their_types() -> None:
    _, tree = shown("stabilizer.estimator=2; pid_rate.roll_*; stabilizer.controller")
    store = ParameterStore(tree)
    names = [name for name in store.names if name.startswith(FIRMWARE)]
    gains = [f"{FIRMWARE}pid_rate.roll_{gain}" for gain in ("kp", "ki", "kd")]
    assert names == [f"{FIRMWARE}stabilizer.{one}" for one in ("estimator", "controller")] + gains
    assert [store.get(name) for name in names] == [2, 1, 250.0, 500.0, 2.5]
    one = store.description(names[0])
    assert (one.type, one.minimum, one.maximum, one.unit) == ("int", 0.0, 255.0, "")
    with pytest.raises(OutOfBoundsError, match=r"estimator = 300 is out of bounds; allowed 0 to"):
        store.set({names[0]: 300})
    with pytest.raises(OutOfBoundsError, match=r"roll_kp = 1e\+39 is out of bounds"):
        store.set({gains[0]: 1e39})


def test_a_slider_of_its_table_is_set_in_flight_and_shows_what_the_crazyflie_has() -> None:
    bench, tree = shown("pid_rate.roll_kp=240; pid_rate.*")
    store, values = ParameterStore(tree), bench.firmware.parameters.values
    kp, ki = f"{FIRMWARE}pid_rate.roll_kp", f"{FIRMWARE}pid_rate.roll_ki"
    assert values["pid_rate.roll_kp"] == store.get(kp) == 240.0
    store.set({kp: 260.1})
    bench.go(300)
    assert values["pid_rate.roll_kp"] == pytest.approx(260.1)
    assert sum(packet.port == CrtpPort.SETPOINT for packet in bench.firmware.taken) >= 5
    assert bench.board.confirmed == {}  # it has what was asked for
    store.set({"board.parameters": "pid_rate.roll_kp=250"})  # the newest change counts
    bench.go(300)
    assert values["pid_rate.roll_kp"] == 250.0
    assert bench.board.confirmed == {kp: 250.0}
    store.set(bench.board.confirmed)
    bench.board.confirmed.clear()
    answer = bench.firmware.parameters.answer

    def stubborn(channel: int, data: bytes) -> Packet | None:
        return answer(channel, data[:2] if channel == WRITE else data)

    bench.firmware.parameters.answer = stubborn  # type: ignore[method-assign]
    store.set({ki: 400.0})
    bench.go(300)
    assert bench.board.confirmed == {ki: 500.0}
    [*_, line] = bench.board.failures
    assert line == "not set: the Crazyflie set pid_rate.roll_ki to 500, not to 400"


@pytest.mark.parametrize(
    ("word", "said"),
    [
        (
            "pid_attitude.rol_kp=7",
            "has no parameter pid_attitude.rol_kp; did you mean pid_attitude.",
        ),
        ("stabilizer.estimator=300", "board.parameters: stabilizer.estimator cannot be 300"),
    ],
)
def test_a_parameter_that_the_firmware_does_not_have_changes_nothing_but_a_line(
    word: str, said: str
) -> None:
    options = CrazyflieOptions()
    bench = Bench(options)
    bench.go(2000)
    bench.board.failures.clear()
    options.parameters = word
    bench.go(300)
    (line,) = bench.board.failures
    assert said in line
    assert line.startswith("not set: ")
    assert bench.board.obstacle == ""
