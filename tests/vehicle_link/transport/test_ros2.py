"""ROS 2 nodes of another implementation receive, send, call and set parameters.

They do so through the station's session.
"""

from __future__ import annotations

import json
import queue
import select
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from quadrotor.parameters import Parameters, ParameterStore, parameter
from tests.support.subscribers import has_subscriber
from tests.waiting import free_port
from vehicle_link import messages
from vehicle_link.messages import encode, header, new
from vehicle_link.messages.records import CommandRequest, Message
from vehicle_link.security.authority import ensure_certificates
from vehicle_link.topics.control_inputs import decode_external_reference, decode_joy
from vehicle_link.topics.measurements import decode_pose
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import serve_parameters
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session, vehicle_session

WAIT = 20.0  # s: a bound, not an expectation
STANDARD = (
    "builtin_interfaces/msg/Time",
    "std_msgs/msg/Header",
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/Pose",
    "geometry_msgs/msg/Point",
    "geometry_msgs/msg/Quaternion",
    "geometry_msgs/msg/PoseWithCovariance",
    "geometry_msgs/msg/TwistWithCovariance",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/Vector3",
    "sensor_msgs/msg/Joy",
    "rcl_interfaces/msg/Parameter",
    "rcl_interfaces/msg/ParameterValue",
    "rcl_interfaces/msg/SetParametersResult",
    "rcl_interfaces/msg/ListParametersResult",
    "rcl_interfaces/msg/ParameterDescriptor",
    "rcl_interfaces/msg/FloatingPointRange",
    "rcl_interfaces/msg/IntegerRange",
)
HASHES = {
    "DescribeParameters": "RIHS01_845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff"
}
"""Type as a live rmw_zenoh announces it; the other one takes bounded sequences for unbounded."""
START = 1_769_851_842_000_000_000


class _Gains(Parameters):
    kp: float = parameter(4.0, unit="1/s²", ge=0.0, le=20.0, description="position gain")


class _Root(Parameters):
    control: _Gains = _Gains()


class Backend:
    def __init__(self) -> None:
        self._store = ParameterStore(_Root().model_copy(deep=True))
        self.descriptions = self._store.descriptions
        self.values = self._store.values
        self.requesters: list[str] = []

    def change(self, values: Any, requester: str) -> Any:
        self.requesters.append(requester)
        return self._store.set(values), self._store.revision


class Peer:
    """Process of the other side."""

    def __init__(self, port: int, definitions: Path) -> None:
        script = Path(__file__).with_name("ros2_node.py")
        self._process = subprocess.Popen(
            [sys.executable, str(script), str(port), str(definitions)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        assert self._next() == "ready"

    def __call__(self, action: str, *arguments: Any) -> Any:
        assert self._process.stdin is not None
        print(json.dumps({"do": action, "with": arguments}), file=self._process.stdin, flush=True)
        said = self._next()
        assert "error" not in said, said
        return said["answer"]

    def _next(self) -> Any:
        stdout = self._process.stdout
        assert stdout is not None
        assert select.select([stdout], [], [], WAIT)[0], "the ROS 2 node does not answer"
        return json.loads(stdout.readline())

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            assert self._process.wait(WAIT) == 0
        finally:
            self._process.kill()


@pytest.fixture(scope="module")
def definitions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return ROS 2's definitions and this project's, by `<package>/msg/<Name>.msg`."""
    folder = tmp_path_factory.mktemp("ros2")
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in STANDARD:
        text, _ = store.generate_msgdef(name, ros_version=2)
        path = folder / f"{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        # Types of the same package are written without it, as in ROS 2's own files.
        path.write_text(text.split("=" * 80)[0].replace(f"\n{name.split('/')[0]}/", "\n"))
    ours = Path(messages.__file__).parent
    for source in [*ours.glob("*/srv/*.srv"), *ours.glob("*/msg/*.msg")]:
        path = folder / source.relative_to(ours)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source.read_text())
    return folder


@pytest.fixture(scope="module")
def vehicle_and_port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Node, int]]:
    """Yield a vehicle's node, and the loopback port of the station that routes to it."""
    tls = ensure_certificates(tmp_path_factory.mktemp("tls"))
    udp, tcp = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
    hub, vehicle = hub_session(tcp), vehicle_session(udp, tls)
    radio = Radio(f"127.0.0.1:{udp}", tls, tcp, lambda: 0.0)
    assert radio.wait(WAIT)
    node = Node(vehicle, "/quad1", "vehicle")
    yield node, tcp
    node.close()
    radio.close(WAIT)
    for session in (hub, vehicle):
        session.close()


@pytest.fixture(scope="module")
def vehicle(vehicle_and_port: tuple[Node, int]) -> Node:
    return vehicle_and_port[0]


@pytest.fixture(scope="module")
def backend(vehicle: Node) -> Backend:
    made = Backend()
    serve_parameters(vehicle, made)
    return made


@pytest.fixture(scope="module")
def peer(vehicle_and_port: tuple[Node, int], backend: Backend, definitions: Path) -> Iterator[Peer]:
    made = Peer(vehicle_and_port[1], definitions)
    yield made
    made.close()


def test_a_node_hears_the_state(vehicle: Node, peer: Peer) -> None:
    publisher = vehicle.advertise(TOPICS["state"])
    peer("subscribe", "/quad1/state", "nav_msgs/msg/Odometry")
    assert has_subscriber(publisher, WAIT), "are the hashes of the type the same?"
    pose = {"pose": {"position": (1.0, -2.0, 3.5)}}
    message = new("nav_msgs/Odometry", header=header(START, "world"), pose=pose)
    publisher.put(encode(message), START)
    heard = peer("hear", "/quad1/state")
    assert heard["header"] == {"stamp": {"sec": 1_769_851_842, "nanosec": 0}, "frame_id": "world"}
    assert heard["pose"]["pose"]["position"] == {"x": 1.0, "y": -2.0, "z": 3.5}


def test_a_node_sends_poses_of_a_tracking_system_and_sticks(vehicle: Node, peer: Peer) -> None:
    heard: queue.SimpleQueue[Received] = queue.SimpleQueue()
    vehicle.subscribe("tracker_pose", TOPICS["tracker_pose"].type_name, heard.put)
    peer("advertise", "/quad1/tracker_pose", "geometry_msgs/msg/PoseStamped")
    stamp = {"of": "builtin_interfaces/msg/Time", "sec": 1_769_851_842, "nanosec": 7}
    head = {"of": "std_msgs/msg/Header", "stamp": stamp, "frame_id": "world"}
    point = {"of": "geometry_msgs/msg/Point", "x": 0.5, "y": 0.25, "z": 1.0}
    turn = {"of": "geometry_msgs/msg/Quaternion", "x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}
    pose = {"of": "geometry_msgs/msg/Pose", "position": point, "orientation": turn}
    received = _sent_until_heard(peer, heard, "/quad1/tracker_pose", {"header": head, "pose": pose})
    sample = decode_pose(received.payload)
    assert sample["stamp_ns"] == START + 7
    assert sample["position_w"].tolist() == [[0.5, 0.25, 1.0]]
    assert sample["quaternion_wb"].tolist() == [[0.0, 0.0, 0.0, 1.0]]  # w first

    vehicle.subscribe("joy", TOPICS["joy"].type_name, heard.put)
    peer("advertise", "/quad1/joy", "sensor_msgs/msg/Joy")
    sticks = {
        "header": head,
        "axes": numbers("float32", 0.5, -1.0, 0.25, 0.0),
        "buttons": numbers("int32", 1),
    }
    joy = decode_joy(_sent_until_heard(peer, heard, "/quad1/joy", sticks).payload)
    assert (tuple(joy.axes), joy.enabled) == ((0.5, -1.0, 0.25, 0.0), True)


def test_a_node_sends_references(vehicle: Node, peer: Peer) -> None:
    heard: queue.SimpleQueue[Received] = queue.SimpleQueue()
    row = TOPICS["external_reference"]
    vehicle.subscribe(row.name, row.type_name, heard.put)
    peer("advertise", "/quad1/external_reference", "quadlab_msgs/msg/Reference")
    stamp = {"of": "builtin_interfaces/msg/Time", "sec": 1_769_851_842, "nanosec": 7}
    vectors = ("position", "velocity", "acceleration", "jerk", "snap")
    fields: dict[str, Any] = {
        name: {"of": "geometry_msgs/msg/Vector3", "x": k + 0.5, "y": -k, "z": 2.0 * k}
        for k, name in enumerate(vectors)
    }
    fields |= {"yaw": 0.5, "yaw_rate": -0.25, "yaw_acceleration": 0.125}
    fields["header"] = {"of": "std_msgs/msg/Header", "stamp": stamp, "frame_id": "world"}
    received = _sent_until_heard(peer, heard, "/quad1/external_reference", fields)
    stamp_ns, reference = decode_external_reference(received.payload)
    assert stamp_ns == START + 7
    assert reference.view("f8").tolist() == [
        *(value for k in range(5) for value in (k + 0.5, -k, 2.0 * k)),
        0.5,
        -0.25,
        0.125,
    ]


def numbers(kind: str, *values: float) -> dict[str, Any]:
    return {"of": kind, "values": values}


def _sent_until_heard(
    peer: Peer, heard: queue.SimpleQueue[Received], topic: str, fields: dict[str, Any]
) -> Received:
    """Send until received, because messages sent before the two have found each other are lost."""
    for _ in range(100):
        peer("publish", topic, fields)
        try:
            return heard.get(timeout=0.2)
        except queue.Empty:
            continue
    raise AssertionError(f"{topic} was not heard")


def test_a_node_calls_a_service(vehicle: Node, peer: Peer) -> None:
    kind = SERVICES["arm"]

    def refuse(request: CommandRequest) -> Message:
        return new(f"{kind}_Response", accepted=False, reason=f"not for {request.requester}")

    vehicle.serve("arm", kind, refuse)
    answer = peer(
        "call",
        "/quad1/arm",
        kind,
        {"request_id": "1", "requester": "a ROS node", "valid_until_ns": 0},
        None,
    )
    assert answer == {"accepted": False, "reason": "not for a ROS node"}


def test_the_parameter_services_list_get_describe_set_and_refuse(
    peer: Peer, backend: Backend
) -> None:
    def call(name: str, fields: dict[str, Any]) -> Any:
        snake = "".join(f"_{c.lower()}" if c.isupper() else c for c in name).strip("_")
        kind = f"rcl_interfaces/srv/{name}"
        return peer("call", f"/quad1/vehicle/{snake}", kind, fields, HASHES.get(name))

    assert call("ListParameters", {"prefixes": [], "depth": 0})["result"]["names"] == ["control.kp"]
    assert call("GetParameterTypes", {"names": ["control.kp"]})["types"] == [3]  # a double
    [described] = call("DescribeParameters", {"names": ["control.kp"]})["descriptors"]
    [bounds] = described["floating_point_range"]
    assert (bounds["from_value"], bounds["to_value"]) == (0.0, 20.0)
    assert "position gain" in described["description"]

    def value(number: float) -> dict[str, Any]:
        return {
            "of": "rcl_interfaces/msg/Parameter",
            "name": "control.kp",
            "value": {
                "of": "rcl_interfaces/msg/ParameterValue",
                "type": 3,
                "bool_value": False,
                "integer_value": 0,
                "double_value": number,
                "string_value": "",
                "byte_array_value": numbers("uint8"),
                "bool_array_value": numbers("bool"),
                "integer_array_value": numbers("int64"),
                "double_array_value": numbers("float64"),
                "string_array_value": [],
            },
        }

    [done] = call("SetParameters", {"parameters": [value(6.5)]})["results"]
    assert done == {"successful": True, "reason": ""}
    [refused] = call("SetParameters", {"parameters": [value(25.0)]})["results"]
    assert not refused["successful"]
    assert "20" in refused["reason"]
    refused = call("SetParametersAtomically", {"parameters": [value(-1.0)]})["result"]
    assert not refused["successful"]
    [now] = call("GetParameters", {"names": ["control.kp"]})["values"]
    assert now["double_value"] == 6.5
    assert set(backend.requesters) == {"ros2 param"}


def test_the_graph_shows_our_topics_and_services(vehicle: Node, peer: Peer) -> None:
    vehicle.advertise(TOPICS["imu"])
    graph = peer("graph", "/quad1/imu")
    assert graph["topics"]["/quad1/imu"] == ["sensor_msgs/msg/Imu"]
    kind = "rcl_interfaces/srv/SetParameters"
    assert graph["services"]["/quad1/vehicle/set_parameters"] == [kind]
