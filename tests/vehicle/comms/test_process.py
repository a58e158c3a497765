"""The vehicle as processes, against the simulator, over the real link.

A whole flight, whose comms process is killed again and again, and all ways in which a process may
end.
"""

from __future__ import annotations

import itertools
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight_log import is_closed, read_attachments, read_log, read_metadata
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.checkout import ROOT
from quadrotor.records import OWN_SENSORS, POSE_SAMPLE, Record
from tests.support.station import StationLink
from tests.waiting import LIMIT as BOUND
from tests.waiting import free_port, wait_for
from vehicle.calibration.store import CalibrationStore
from vehicle.onboard_log.repair import torn_logs
from vehicle.processes.config import TICK_SLOTS
from vehicle.processes.parent import DEATHS_OUTLASTED
from vehicle_link import messages, telemetry
from vehicle_link.parameters.messages import from_value, to_parameters
from vehicle_link.security.authority import ensure_certificates
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.measurements import encode_bearings, pose_messages
from vehicle_link.topics.table import SERVICES, TOPICS, Topic
from vehicle_link.topics.ticks import decode_odometry
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import ParameterClient
from vehicle_link.transport.publisher import Received

SIMULATOR = """
import sys
from pathlib import Path
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.process import run
run(SimulatorParameters(), Path(sys.argv[1]), int(sys.argv[2]) or None)
"""

VEHICLE = """
import sys
from pathlib import Path
from vehicle.processes.parent import run_vehicle
sys.exit(run_vehicle([f"{sys.argv[1]}/mcu0", f"{sys.argv[1]}/mcu1"], Path(sys.argv[2]),
                     int(sys.argv[3]),
                     settings={"model.mass": 1.3, "safety.link_land_after": 60.0,
                               "safety.pose_reaction": "none"}))
"""


BRIDGED = TICK_SLOTS / 500 - 1.0
"""Time without a comms process whose ticks wait in the ring, s."""


class VehicleProcesses:
    """A simulator and `run_vehicle`, each a separate process."""

    def __init__(self, folder: Path, loopback_port: int = 0) -> None:
        self.data = folder / "data"
        self.data.mkdir(exist_ok=True)
        self.link_port = free_port(socket.SOCK_DGRAM)
        self.loopback_port = loopback_port
        self.errors_path = folder / "errors"
        serial = str(folder / "serial")
        self.simulator = self._start(SIMULATOR, serial, str(loopback_port))
        self.vehicle = self._start(VEHICLE, serial, str(self.data), str(self.link_port))

    def child(self, module: str) -> int:
        """Return the process id of the flight or comms process, 0 when there is none."""
        path = Path(f"/proc/{self.vehicle.pid}/task/{self.vehicle.pid}/children")
        for pid in path.read_text().split():
            with suppress(OSError):  # it may end while it is read
                if module.encode() in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0"):
                    return int(pid)
        return 0

    def children(self) -> tuple[int, int]:
        wait_for(
            lambda: self.child("vehicle.flight.process") and self.child("vehicle.comms.process"),
            what="both children",
        )
        return self.child("vehicle.flight.process"), self.child("vehicle.comms.process")

    def errors(self) -> str:
        return self.errors_path.read_text()

    def stop(self) -> None:
        for process in (self.vehicle, self.simulator):
            if process.poll() is None:
                process.terminate()
            process.wait(BOUND)

    def _start(self, program: str, *arguments: str) -> subprocess.Popen[bytes]:
        with self.errors_path.open("ab") as errors:
            return subprocess.Popen(
                [sys.executable, "-c", program, *arguments], cwd=ROOT, stderr=errors
            )


class FakeStation:
    """Fake station, which sends truth as tracker poses, heartbeats and calls; stores messages."""

    def __init__(self, vehicle: VehicleProcesses) -> None:
        files = ensure_certificates(vehicle.data / "certificates")
        self._link = StationLink(vehicle.link_port, files, vehicle.loopback_port)
        self.node = Node(self._link.session, "/quad1", "station")
        self.counts: Counter[str] = Counter()
        self.newest: dict[str, Any] = {}
        self.events: list[str] = []
        self.changes: list[str] = []
        self.ticks: Record | None = None
        for topic in TOPICS.values():
            if topic.sender == "vehicle":
                self.node.subscribe(topic.name, topic.type_name, self._receiver(topic))
        self._poses = self.node.advertise(TOPICS["tracker_pose"])
        self._beats = self.node.advertise(TOPICS["station_heartbeat"])
        self._bearings = self.node.advertise(TOPICS["bearings"])
        self.node.subscribe("truth", TOPICS["truth"].type_name, self._truth)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._beat)
        self._thread.start()

    def call(self, service: str, **fields: object) -> Any:
        srv_type = SERVICES[service]
        client = self.node.client(service, srv_type)
        return client.call(messages.new(f"{srv_type}_Request", **fields), 3.0)

    def command(self, service: str, request_id: str, **fields: object) -> Any:
        return self.call(service, request_id=request_id, requester="anna", **fields)

    def send_bearings(self, stamp_ns: int) -> None:
        lines = np.array([[1.0, 1.0, -0.9], [-1.0, 1.0, -0.9], [-1.0, -1.0, -0.9], [1, -1, -0.9]])
        lines /= np.linalg.norm(lines, axis=1)[:, None]
        self._bearings.put(encode_bearings(stamp_ns, (1, 2, 3, 4), lines, 0.02), stamp_ns)

    @property
    def mode(self) -> str:
        return str(self.newest["status"].mode) if "status" in self.newest else ""

    @property
    def height(self) -> float:
        return 0.0 if self.ticks is None else float(self.ticks["state"]["position_w"][-1, 2])

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        self._link.close()

    def _receiver(self, topic: Topic) -> Callable[[Received], None]:
        def receive(received: Received) -> None:
            self.counts[topic.name] += 1
            if topic.name == "telemetry":
                self.ticks = telemetry.unpack(received.payload)[1]
                return
            message: Any = messages.decode(received.payload, topic.type_name)
            self.newest[topic.name] = message
            if topic.name == "events":
                self.events.append(message.msg)
            elif topic.name == "parameter_changes":
                old, new = from_value(message.old_value), from_value(message.new_value)
                self.changes.append(f"{message.name} {old!r} {new!r}")

        return receive

    def _truth(self, received: Received) -> None:
        stamp_ns, state = decode_odometry(received.payload)
        sample = np.zeros(1, POSE_SAMPLE)
        sample["stamp_ns"] = stamp_ns
        sample["position_w"] = state["position_w"]
        sample["quaternion_wb"] = state["quaternion_wb"]
        self._poses.put(pose_messages(sample).tobytes(), stamp_ns)

    def _beat(self) -> None:
        number = 0
        while not self._closing.wait(0.05):
            number += 1
            now_ns = time.time_ns()
            self._beats.put(encode_heartbeat(number, now_ns), now_ns)


@contextmanager
def vehicle_processes(folder: Path, loopback_port: int = 0) -> Iterator[VehicleProcesses]:
    processes = VehicleProcesses(folder, loopback_port)
    try:
        yield processes
    finally:
        processes.stop()


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def stamps_of(paths: list[Path], topic: str) -> np.ndarray:
    """Return the source stamps of all messages of the topic, ns, over several files."""
    return np.array([m.publish_ns for path in paths for m in read_log(path, [f"/quad1/{topic}"])])


def check_link(station: FakeStation) -> None:
    whoami = station.call("whoami")
    assert (whoami.name, whoami.role) == ("quad1", "vehicle")
    sent = time.time_ns()
    sync = station.call("time_sync", client_sent_ns=sent)
    # The simulated vehicle uses this host's clock.
    assert sent - 50e6 < sync.server_received_ns <= sync.server_sent_ns < time.time_ns() + 50e6
    expected = {t.name for t in TOPICS.values() if t.sender == "vehicle" and t.rate > 0}
    expected -= {f"sensor_{place}" for place in range(1, OWN_SENSORS + 1)}  # without plugins

    def complete() -> bool:
        station.send_bearings(time.time_ns())  # a stream: the first ones have no pose
        return expected <= set(station.counts)

    wait_for(complete, what=f"every topic of {expected}")


def check_parameters(station: FakeStation) -> None:
    client = ParameterClient(station.node, "/quad1/vehicle")
    assert client.values()["model.mass"] == 1.3
    changed: Mapping[str, float] = {"model.mass": 1.308}
    reply = station.command("change_parameters", "p1", parameters=to_parameters(changed))
    assert (reply.accepted, reply.revision) == (True, 1)
    wait_for(lambda: station.changes == ["model.mass 1.3 1.308"], what="the parameter change")
    wrong = to_parameters({"model.mass": 13.0})
    refused = station.command("change_parameters", "p2", parameters=wrong)
    assert not refused.accepted
    assert "allowed 0.02 to 2.4 kg" in refused.reason


def check_calibrations(station: FakeStation) -> None:
    """Check that a calibration is stored, found and refused; one stored before is in force."""
    assert ParameterClient(station.node, "/quad1/vehicle").values()["model.motor_offset"] == 14.5
    wait_for(
        lambda: any("is not in force: --set model.mass=1.3" in text for text in station.events),
        what="the lines on calibrations in force",
    )
    found = station.command("calibrate", "c1", action="gyroscope")
    assert found.accepted, found.reason
    arm = CalibrationRecord(name="arm", values={"model.arm": 0.251}, run_id="run_7")
    stored = station.command("calibrate", "c2", action="store", record=arm.model_dump_json())
    assert stored.accepted, stored.reason
    assert parse_record(stored.records[0]).previous == {"model.arm": 0.25}
    wait_for(lambda: "model.arm 0.25 0.251" in station.changes, what="the calibration's change")
    history = station.command("calibrate", "c3", action="history")
    names = [parse_record(text).name for text in history.records]
    assert names[:2] == ["arm", "gyroscope"]
    assert "motor" in names
    refused = station.command("bench", "c4", motor=2, reference=60, secured=False)
    assert not refused.accepted
    assert "confirm first that the propellers are off" in refused.reason


def take_off(station: FakeStation) -> None:
    refused = station.command("start_behavior", "b0", name="take_off")
    assert not refused.accepted
    assert "arm the vehicle first" in refused.reason
    ids = (f"a{number}" for number in itertools.count(10))
    arming = ""

    def is_armed() -> bool:  # not while a busy machine holds up the poses
        nonlocal arming
        arming = next(ids)
        return bool(station.command("arm", arming).accepted)

    wait_for(is_armed, what="arming")
    again = station.command("arm", arming)
    assert again.accepted, "the same request id gets the same answer"
    other = station.command("arm", "a2")
    assert (other.accepted, other.reason) == (False, "already armed")
    wait_for(lambda: station.mode == "armed", what="armed")
    checks = station.call("checks", again=True)
    assert not checks.accepted
    assert checks.reason == "the vehicle is armed; checks are made on the ground"
    fields = {"name": "take_off", "arguments": to_parameters({"height": 0.8})}
    assert station.command("start_behavior", "b1", **fields).accepted
    wait_for(lambda: station.height > 0.7, what="height 0.7 m")


def survive_comms(station: FakeStation, processes: VehicleProcesses) -> float:
    """Kill comms; return the time until telemetry of the next one has arrived, s."""
    flight, comms = processes.children()
    station.counts.clear()
    os.kill(comms, signal.SIGKILL)
    killed = time.monotonic()
    wait_for(
        lambda: processes.child("vehicle.comms.process") not in (0, comms),
        what="a new comms process",
    )
    wait_for(lambda: station.counts["telemetry"] > 10, what="telemetry again")
    outage = time.monotonic() - killed
    assert processes.child("vehicle.flight.process") == flight
    assert station.height > 0.6
    values = ParameterClient(station.node, "/quad1/vehicle").values()
    assert values["model.mass"] == 1.308, "changed before the comms process lived"
    return outage


def land_when_comms_dies_again_and_again(
    station: FakeStation, processes: VehicleProcesses
) -> list[float]:
    """Kill each comms process that has a link, until the vehicle lands in the pause; return the
    times without one, s.
    """
    usual = to_parameters({"safety.link_land_after": 2.0})
    assert station.command("change_parameters", "p3", parameters=usual).accepted

    killed: list[float] = []
    outages: list[float] = []

    def has_begun() -> bool:
        if station.counts["telemetry"] <= 10:
            return False
        outages.extend(time.monotonic() - one for one in killed[len(outages) :])
        if not station.command("start_behavior", f"again{len(killed)}", name="brake").accepted:
            return True
        station.counts.clear()
        os.kill(processes.children()[1], signal.SIGKILL)
        killed.append(time.monotonic())
        return False

    wait_for(has_begun, what="the vehicle's landing by itself")
    return outages


def check_logs(processes: VehicleProcesses, outages: list[float]) -> None:
    """Check what is in the files of all comms processes.

    Args:
        outages: times without a comms process, s, of which the rings bridge the first seconds.
    """
    paths = sorted((processes.data / "onboard").glob("*.mcap"))
    assert len(paths) > DEATHS_OUTLASTED
    for path in paths[:DEATHS_OUTLASTED]:
        assert read_metadata(path)["quadlab.recovered"]["messages"] != "0"
    assert b'"model.mass": 1.308' in read_attachments(paths[1])["parameters.json"]
    run = read_metadata(paths[1])["quadlab.run"]
    assert (run["recorder"], run["robot_id"], run["firmware_revision"]) == ("onboard", "1", "1")
    for path in paths:
        carried = json.loads(read_attachments(path)["calibrations.json"])["in_force"]
        assert set(carried) == {"motor", "gyroscope", "arm"}
        assert carried["gyroscope"]["requester"] == "anna"
    beyond = [max(0.0, 1e9 * (outage - BRIDGED)) for outage in outages]
    for topic in ("state", "reference", "imu", "actuators"):
        gaps = np.diff(np.unique(stamps_of(paths, topic)))
        # More than a few consecutive ticks are missing only if the machine stalled.
        assert gaps[gaps > 10_000_000].sum() <= 300_000_000 + sum(beyond), topic
        # Ticks that the killed process had not written are in the next file.
        killed, following = (stamps_of([path], topic) for path in paths[:2])
        assert following[0] - killed[-1] <= 10_000_000 + beyond[0], topic
    kept = {m.topic for path in paths for m in read_log(path)}
    assert {"/quad1/tracker_pose", "/quad1/events", "/quad1/estimator"} <= kept
    # Here and not by the link: the station may not have found the new process yet when it is said.
    told = [
        messages.decode(m.payload, "rcl_interfaces/Log").msg
        for path in paths
        for m in read_log(path, ["/quad1/events"])
    ]
    assert any(text.startswith("emergency land: still no heartbeat") for text in told), told


def check_files(station: FakeStation, processes: VehicleProcesses) -> None:
    """Check the list of the vehicle's logs and a part of one, over the link."""

    def newest_is_whole() -> bool:
        newest = station.call("onboard_files").files[0]
        return bool(newest.closed and not newest.recovered)

    # The status arrives before what the last process has found in the rings is written.
    wait_for(newest_is_whole, what="the log of the last comms process")
    files = station.call("onboard_files").files
    recovered = [file.recovered for file in files]
    assert recovered == [False] + [True] * (len(files) - 1)
    path = processes.data / "onboard" / files[0].name
    part = station.call("onboard_part", name=path.name, offset=1000, length=2800)
    assert part.accepted, part.reason
    assert part.data.tobytes() == path.read_bytes()[1000:3800]


@pytest.mark.alone
def test_a_flight_goes_on_when_comms_is_killed(tmp_path: Path) -> None:
    motor = CalibrationRecord(name="motor", values={"model.motor_offset": 14.5}, stamp_ns=1)
    mass = CalibrationRecord(name="mass", values={"model.mass": 1.25}, stamp_ns=2)
    for record in (motor, mass):
        CalibrationStore(tmp_path / "data", print).append(record)
    with vehicle_processes(tmp_path, free_port(socket.SOCK_STREAM)) as processes:
        station = FakeStation(processes)
        try:
            wait_for(lambda: station.mode == "ready", what="ready")
            check_link(station)
            check_parameters(station)
            check_calibrations(station)
            take_off(station)
            outages = []
            for death in range(DEATHS_OUTLASTED):
                outages.append(survive_comms(station, processes))
                braking = station.command("start_behavior", f"b{2 + death}", name="brake")
                assert braking.accepted, "\n".join([braking.reason, *station.events[-10:]])
            outages += land_when_comms_dies_again_and_again(station, processes)
            wait_for(lambda: station.mode == "ready", what="landed and disarmed")
            logs = processes.data / "onboard"
            wait_for(lambda: all(map(is_closed, logs.glob("*.mcap"))), what="closed onboard logs")
            wait_for(lambda: torn_logs(processes.data) == [], what="recovery of the torn log")
            check_files(station, processes)
        finally:
            station.close()
        children = processes.children()
        processes.vehicle.terminate()
        assert processes.vehicle.wait(BOUND) == 0
        assert not any(map(alive, children))
        assert "Traceback" not in processes.errors()
        check_logs(processes, outages)


def test_the_vehicle_ends_when_flight_dies(tmp_path: Path) -> None:
    with vehicle_processes(tmp_path) as processes:
        flight, comms = processes.children()
        os.kill(flight, signal.SIGKILL)
        assert processes.vehicle.wait(BOUND) == 1
        assert not alive(comms)
        assert "flight process was killed by SIGKILL; vehicle ends" in processes.errors()


def test_no_process_stays_when_the_parent_is_killed(tmp_path: Path) -> None:
    with vehicle_processes(tmp_path) as processes:
        children = processes.children()
        processes.vehicle.kill()
        processes.vehicle.wait(BOUND)
        wait_for(lambda: not any(map(alive, children)), what="the end of both children")


def test_a_link_port_in_use_is_one_line_and_the_end(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("0.0.0.0", 0))
        port = taken.getsockname()[1]
        vehicle = subprocess.run(
            [sys.executable, "-c", VEHICLE, str(tmp_path), str(tmp_path), str(port)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=BOUND,
            check=False,
        )
    assert vehicle.returncode == 1
    (line,) = vehicle.stderr.splitlines()
    assert f"UDP port {port} of 0.0.0.0 is in use" in line


def test_the_flight_process_loads_neither_network_nor_log() -> None:
    program = (
        "import sys, vehicle.flight.process, vehicle.flight.warm_up; "
        "print({m.split('.')[0] for m in sys.modules} & {'zenoh', 'rosbags', 'mcap'})"
    )
    words = [sys.executable, "-c", program]
    loaded = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    assert loaded.stdout == "set()\n"
