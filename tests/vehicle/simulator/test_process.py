"""Simulator in real time: serial devices that may be opened and closed, truth on the same clock."""

from __future__ import annotations

import itertools
import json
import math
import os
import select
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh

from quadrotor.errors import LinkError, StorageError
from quadrotor.records import new_state
from vehicle.boards.board import RawSample
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator import process, robot
from vehicle.simulator.force_sensor import ForceReading
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.process import run
from vehicle.simulator.pseudo_terminal import PseudoTerminal
from vehicle.simulator.robot import RunStatistics
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.simulator.truth import Put, TruthPublisher
from vehicle_link.messages import decode, stamp_of
from vehicle_link.serial.port import PortError
from vehicle_link.serial.serial_port import SerialPort
from vehicle_link.topics.ticks import decode_odometry
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

BOUND = 30.0
"""Time, in s, after which a waiting test fails."""


class Simulator(threading.Thread):
    """`run` in a thread, stopped by the test."""

    def __init__(self, folder: Path, loopback_port: int | None = None) -> None:
        super().__init__()
        self.stop = threading.Event()
        self.statistics = RunStatistics()
        self._arguments = (SimulatorParameters(), folder, loopback_port)

    def run(self) -> None:
        self.statistics = run(*self._arguments, stop=self.stop)


@contextmanager
def simulator(folder: Path, loopback_port: int | None = None) -> Iterator[Simulator]:
    thread = Simulator(folder, loopback_port)
    thread.start()
    try:
        yield thread
    finally:
        thread.stop.set()
        thread.join(BOUND)


def open_ports(folder: Path) -> list[SerialPort]:
    links = [folder / "mcu0", folder / "mcu1"]
    waited = threading.Event()
    for _ in range(int(BOUND / 0.01)):
        if all(link.exists() for link in links):
            break
        waited.wait(0.01)
    return [SerialPort(link) for link in links]


def receive(mcu: Microcontroller, count: int) -> list[RawSample]:
    """Return at least `count` samples; each wait for bytes is bounded."""
    samples: list[RawSample] = []
    while len(samples) < count:
        ready = select.select(mcu.filenos(), [], [], BOUND)[0]
        assert ready, f"no bytes in {BOUND:.0f} s"
        samples += mcu.receive()
        mcu.service(0.0)
    return samples


def test_it_speaks_through_two_devices_and_removes_them(tmp_path: Path) -> None:
    with simulator(tmp_path) as running:
        ports = open_ports(tmp_path)
        mcu = Microcontroller(ports)
        samples = receive(mcu, 100)
        for port in ports:
            port.close()
    assert mcu.connected
    # The microcontroller counts whole milliseconds; the vehicle's clock may have been set back.
    assert len({sample.stamp_ns % 1_000_000 for sample in samples}) <= 1 + len(mcu.failures)
    assert running.statistics.periods >= 200
    assert os.listdir(tmp_path) == []


def test_a_vehicle_may_leave_and_come_back(tmp_path: Path) -> None:
    with simulator(tmp_path):
        for _ in range(2):
            ports = open_ports(tmp_path)
            mcu = Microcontroller(ports)
            receive(mcu, 20)
            assert mcu.connected
            for port in ports:
                port.close()


def test_several_vehicles_stand_apart_and_speak_for_themselves(tmp_path: Path) -> None:
    stop, names = threading.Event(), ("a", "b", "c")
    thread = threading.Thread(
        target=run,
        args=(SimulatorParameters(), tmp_path, None),
        kwargs={"vehicles": names, "stop": stop},
    )
    thread.start()
    for name in names:
        ports = open_ports(tmp_path / name)
        mcu = Microcontroller(ports)
        assert len(receive(mcu, 20)) >= 20
        assert mcu.connected
        for port in ports:
            port.close()
    stop.set()
    thread.join(BOUND)
    assert [os.listdir(tmp_path / name) for name in names] == [[], [], []]


def test_vehicles_side_by_side_are_a_metre_apart_with_noise_of_their_own() -> None:
    stands = process.side_by_side(SimulatorParameters(), 8)
    places = [(one.start_x, one.start_y) for one in stands]
    assert places[0] == (-1.5, -0.5)
    assert places[7] == (1.5, 0.5)
    assert len({one.seed for one in stands}) == 8
    nearest = min(math.dist(a, b) for a, b in itertools.combinations(places, 2))
    assert nearest == pytest.approx(1.0)
    truth = SimulatedVehicle(stands[7]).truth["position_w"][0]
    assert truth[:2] == pytest.approx((1.5, 0.5))


def test_it_goes_on_while_the_station_is_away(tmp_path: Path) -> None:
    with simulator(tmp_path, loopback_port=1) as running:
        ports = open_ports(tmp_path)
        receive(Microcontroller(ports), 50)
        for port in ports:
            port.close()
    assert not running.is_alive()


def test_when_the_machine_stopped_the_lost_samples_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "GIVE_UP_NS", -(10**12))  # every sample is "too late" …
    thread = Simulator(tmp_path)  # this process hurries, not the tests after it
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        if len(said) > 3:
            thread.stop.set()

    monkeypatch.setattr(process, "_say", say)
    thread.start()
    thread.join(BOUND)
    assert not thread.is_alive()
    assert thread.statistics.periods <= 2
    assert "samples are lost" in said[-1]


def test_unread_bytes_are_bounded_thrown_away_and_counted(tmp_path: Path) -> None:
    terminal = PseudoTerminal(tmp_path / "mcu0")
    for index in range(3000):
        terminal.write(b"%033d\r" % index)
    slave = os.open(tmp_path / "mcu0", os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    waiting, index = b"", 3000
    while not waiting.endswith(b"%033d\r" % (index - 1)):  # all bytes sent have arrived
        terminal.write(b"%033d\r" % index)
        index += 1
        assert select.select([slave], [], [], BOUND)[0], "nothing came"
        waiting += os.read(slave, 10_000)
    assert terminal.dropped == index * 34 - len(waiting)
    assert terminal.dropped > 1000 * 34
    os.close(slave)
    terminal.close()


def test_a_pulled_adapter_is_gone_for_the_vehicle_and_comes_back_as_a_new_device(
    tmp_path: Path,
) -> None:
    terminal = PseudoTerminal(tmp_path / "mcu0")
    port = SerialPort(tmp_path / "mcu0")
    terminal.write(b"#before\r")
    terminal.unplug()
    assert not os.path.lexists(tmp_path / "mcu0")
    terminal.write(b"#lost\r")
    assert terminal.read() == b""
    with pytest.raises(PortError, match="is gone"):
        _ = [port.read() for _ in range(2)]  # earlier bytes may still be there
    with pytest.raises(PortError, match="is gone"):
        port.write(b"x")
    port.close()
    terminal.plug_in()
    port = SerialPort(tmp_path / "mcu0")
    terminal.write(b"#after\r")
    assert select.select([port], [], [], BOUND)[0]
    assert port.read() == b"#after\r"
    port.close()
    terminal.close()


def test_a_newer_simulator_s_link_is_left_alone(tmp_path: Path) -> None:
    old, new = PseudoTerminal(tmp_path / "mcu0"), PseudoTerminal(tmp_path / "mcu0")
    old.close()
    assert os.readlink(tmp_path / "mcu0") == new.device
    new.close()
    assert not os.path.lexists(tmp_path / "mcu0")


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match=r"cannot make the serial device's link .*--folder"):
        PseudoTerminal(tmp_path / "file" / "mcu0")


def test_sigterm_and_sigint_stop_it() -> None:
    numbers = (signal.SIGTERM, signal.SIGINT)
    before = [signal.getsignal(number) for number in numbers]
    try:
        for number in numbers:
            stop = process._stop_on_signals()
            assert not stop.is_set()
            signal.raise_signal(number)
            assert stop.is_set()
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


# ---------------------------------------------------------------- truth
class Receiver:
    """Output of a TruthPublisher, and what it has sent."""

    def __init__(self, refusals: int = 0) -> None:
        self.payloads: list[tuple[bytes, int]] = []
        self.arrived = threading.Semaphore(0)
        self.closed = threading.Event()
        self._refusals = refusals

    def connect(self) -> tuple[Put, Callable[[], None]]:
        if self._refusals:
            self._refusals -= 1
            raise LinkError("no station")
        return self._put, self.closed.set

    def _put(self, payload: bytes, source_ns: int, topic: str = "truth", /) -> None:
        self.payloads.append((payload, source_ns))
        self.arrived.release()


def test_truth_is_sent_as_odometry_with_its_stamp() -> None:
    receiver = Receiver()
    publisher = TruthPublisher(receiver.connect, "quad1")
    state = new_state()
    sent = False
    while not sent:  # what is offered before the session is open is dropped as old
        state["position_w"] = (1.0, 2.0, 3.0)
        publisher.offer(1_700_000_000_123_456_789, state)
        state["position_w"] = 0.0  # it was copied
        sent = receiver.arrived.acquire(timeout=0.2)
    publisher.close()
    payload, source_ns = receiver.payloads[0]
    stamp_ns, truth = decode_odometry(payload)
    assert stamp_ns == source_ns == 1_700_000_000_123_456_789
    assert truth["position_w"][0].tolist() == [1.0, 2.0, 3.0]
    assert receiver.closed.is_set()


def test_a_reading_of_the_bench_is_sent_on_its_topic_with_its_stamp() -> None:
    sent: list[tuple[bytes, int, str]] = []
    arrived = threading.Event()

    def put(payload: bytes, source_ns: int, topic: str = "truth", /) -> None:
        sent.append((payload, source_ns, topic))
        arrived.set()

    publisher = TruthPublisher(lambda: (put, lambda: None), "quad1")
    reading = ForceReading(7, 1.5, -0.02, 99.0)
    while not arrived.wait(0.1):
        publisher.offer_reading(1_700_000_000_000_000_007, reading)
    publisher.close()
    payload, source_ns, topic = sent[0]
    message = decode(payload, "quadlab_msgs/BenchReading")
    assert topic == "bench_reading"
    assert stamp_of(message) == source_ns == 1_700_000_000_000_000_007
    assert (message.force, message.torque, message.speed) == (1.5, -0.02, 99.0)


def test_the_truth_s_thread_hurries_and_the_network_s_threads_do_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policies: list[tuple[str, int]] = []
    receiver = Receiver()

    def scheduled(pid: int, policy: int, parameter: os.sched_param) -> None:
        assert pid == 0, "of this thread only"
        policies.append((threading.current_thread().name, policy))

    def connect() -> tuple[Put, Callable[[], None]]:
        assert policies[-1] == ("truth", os.SCHED_OTHER)
        return receiver.connect()

    monkeypatch.setattr(os, "sched_setscheduler", scheduled)
    publisher = TruthPublisher(connect, "quad1")
    while not receiver.arrived.acquire(timeout=0.1):
        publisher.offer(1, new_state())
    assert policies[-1] == ("truth", os.SCHED_FIFO)
    publisher.close()


def test_a_slow_network_costs_truth_and_not_the_plant() -> None:
    blocked = threading.Event()

    def connect() -> tuple[Put, Callable[[], None]]:
        blocked.wait(BOUND)
        raise LinkError("no station")

    publisher = TruthPublisher(connect, "quad1")
    for k in range(100):
        publisher.offer(k, new_state())
    assert publisher.dropped == 92
    publisher._stop.set()
    blocked.set()
    publisher.close()


def station(loopback_port: int) -> zenoh.Session:
    """Yield what the simulator needs of a station: a router on loopback."""
    config = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{loopback_port}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def test_a_station_that_comes_later_and_comes_again_gets_the_truth(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with simulator(tmp_path, loopback_port=port):
        for _ in range(2):
            arrived = threading.Event()
            payloads: list[bytes] = []

            def take(
                received: Received,
                payloads: list[bytes] = payloads,
                arrived: threading.Event = arrived,
            ) -> None:
                payloads.append(received.payload)
                arrived.set()

            session = station(port)
            node = Node(session, "/quad1", "test")
            node.subscribe("truth", "nav_msgs/Odometry", take)
            assert arrived.wait(BOUND), "no truth arrived"
            node.close()
            session.close()
            _, truth = decode_odometry(payloads[0])
            assert truth["position_w"][0] == pytest.approx([0, 0, 0], abs=1e-9)


def test_truth_and_vehicle_share_a_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    receiver = Receiver()
    monkeypatch.setattr(robot, "connect_to_station", lambda *_: receiver.connect)
    with simulator(tmp_path, loopback_port=1):
        ports = open_ports(tmp_path)
        sample = receive(Microcontroller(ports), 100)[-1]
        assert receiver.arrived.acquire(timeout=BOUND)
        for port in ports:
            port.close()
    stamp_ns = receiver.payloads[-1][1]
    # The same grid of 10 ms, shifted by the least delay of a sample on its way; a loaded test
    # machine may lengthen that.
    shift = (sample.stamp_ns - stamp_ns) % 2_000_000
    assert min(shift, 2_000_000 - shift) < 1_000_000
    assert abs(sample.stamp_ns - stamp_ns) < 5_000_000_000
