"""Parts of comms, without Zenoh: clock, commands and replies, sending, receiving."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bearing_sim.beacons import PAPER_BEACONS
from control.behaviors.table import BehaviorName
from estimation.outcome import LATEST_NS
from quadrotor.errors import LinkError, ParameterError, RefusedError
from quadrotor.records import JUDGED_READING, NO_ATTITUDE, POSE_SAMPLE, TICK, Record, pose_sample
from tests.support.narrowing import now
from vehicle import mailbox
from vehicle.comms.commands import FlightMailbox, FlightParameters
from vehicle.comms.deferred_events import DeferredEvents
from vehicle.comms.inbound import Inbound
from vehicle.comms.publish import Publisher, flag_names, samples_a_packet
from vehicle.comms.services import check_in_time
from vehicle.comms.vehicle_clock import WINDOW_NS, VehicleClock
from vehicle.modes import Flag, Mode
from vehicle.processes.config import create_rings, open_rings
from vehicle_link import clock, messages, telemetry
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.topics.control_inputs import encode_heartbeat, encode_joy
from vehicle_link.topics.measurements import encode_bearings, pose_messages, position_messages
from vehicle_link.topics.table import TOPICS

MS = 1_000_000
SECOND = 1000 * MS
START_NS = 1_780_000_000_000_000_000


# -------------------------------------------------------------------------------- the clock
class FakeTime:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.monotonic = 5 * SECOND
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.monotonic)
        monkeypatch.setattr(clock, "time_ns", lambda: START_NS)


@pytest.fixture
def fake_time(monkeypatch: pytest.MonkeyPatch) -> FakeTime:
    return FakeTime(monkeypatch)


def test_before_the_first_tick_the_clock_is_the_hosts(fake_time: FakeTime) -> None:
    clock = VehicleClock()
    fake_time.monotonic += 3 * MS
    assert not clock.started
    assert clock.now_ns() == START_NS + 3 * MS


def test_the_least_delayed_tick_sets_the_clock(fake_time: FakeTime) -> None:
    clock = VehicleClock()
    seed = 11
    print("seed", seed)
    delays = np.random.default_rng(seed).integers(MS // 10, 12 * MS, 200)
    delays[77] = MS // 10
    for k, delay in enumerate(delays):
        clock.observe(START_NS + 10 * MS * k, 10 * MS * k + int(delay))
    fake_time.monotonic = 2 * SECOND
    assert clock.now_ns() == START_NS + 2 * SECOND - MS // 10


def test_the_time_of_a_sample_on_the_line_is_no_part_of_the_delay(fake_time: FakeTime) -> None:
    clock = VehicleClock(3 * MS)
    clock.observe(START_NS, 3 * MS + MS // 10)
    fake_time.monotonic = 5 * MS
    assert clock.now_ns() == START_NS + 5 * MS - MS // 10


def test_the_clock_follows_drift(fake_time: FakeTime) -> None:
    clock, rate = VehicleClock(), 1 - 50e-6  # the vehicle's clock is slow by 50 ppm
    for k in range(6000):
        read = 10 * MS * k
        clock.observe(START_NS + round(read * rate), read)
    fake_time.monotonic = 60 * SECOND
    true = START_NS + round(60 * SECOND * rate)
    assert 0 <= clock.now_ns() - true <= 50e-6 * WINDOW_NS + 1000


# -------------------------------------------------------------------------------- commands
class Flight:
    """The flight process's end of the rings, driven by a test."""

    def __init__(self) -> None:
        self.rings = open_rings(create_rings())
        self.mailbox = FlightMailbox(self.rings)

    def received(self) -> list[mailbox.Inbound]:
        return [mailbox.decode_inbound(data) for data in self.rings.inbox.pop_all()]

    def measured(self) -> list[Record]:
        """Return the samples of either ring."""
        rings = self.rings
        return [*rings.poses.pop_all(), *rings.bearings.pop_all()]

    def commands(self) -> list[mailbox.Command]:
        return [one for one in self.received() if not isinstance(one, mailbox.Measurement)]


def answer(flight: Flight, accepted: bool, reason: str = "", **fields: object) -> threading.Thread:
    """Reply to the next command, as comms' draining thread would deliver it."""

    def run() -> None:
        waited = threading.Event()
        for _ in range(500):
            for command in flight.commands():
                reply = mailbox.Reply(command.request_id, accepted, reason, **fields)  # type: ignore[arg-type]
                flight.mailbox.deliver(mailbox.Reply("somebody else's", True))
                flight.mailbox.deliver(reply)
                return
            waited.wait(0.01)

    thread = threading.Thread(target=run)
    thread.start()
    return thread


def test_a_command_gets_its_own_reply() -> None:
    flight = Flight()
    thread = answer(flight, False, "not armed: keep it still")
    reply = flight.mailbox.ask(lambda i: mailbox.Arm(i, "anna"))
    thread.join()
    assert (reply.accepted, reply.reason) == (False, "not armed: keep it still")


def test_no_reply_is_one_clear_error() -> None:
    flight = Flight()
    with pytest.raises(LinkError, match=r"has not answered within 0\.01 s"):
        flight.mailbox.ask(lambda i: mailbox.Arm(i, "anna"), timeout_s=0.01)
    (command,) = flight.commands()
    flight.mailbox.deliver(mailbox.Reply(command.request_id, True))  # too late: no caller waits


def test_a_command_too_long_for_its_slot_is_refused() -> None:
    flight = Flight()
    with pytest.raises(LinkError, match="too long, at most 8188"):
        flight.mailbox.ask(lambda i: mailbox.StartBehavior(i, "anna", "x" * 9000, {}))
    assert flight.received() == []


def test_a_command_that_arrives_late_is_refused_and_told() -> None:
    arm = messages.new("quadlab_msgs/srv/Command_Request", requester="anna")
    told: list[str] = []

    def check(valid_until_ns: int) -> None:
        arm.valid_until_ns = valid_until_ns
        check_in_time("arm", arm, START_NS, lambda _, text: told.append(text))

    check(0)  # of a client that knows no limit
    check(START_NS)
    assert told == []
    with pytest.raises(
        RefusedError, match=r"^it arrived 2\.5 s too late over the link; send the command"
    ):
        check(START_NS - 2500 * MS)
    assert told == ["arm by anna arrived 2.5 s too late over the link: it was not carried out"]


def test_a_full_inbox_is_said() -> None:
    flight = Flight()
    while flight.mailbox.send(mailbox.Heartbeat(1)):
        pass
    with pytest.raises(LinkError, match="inbox is full"):
        flight.mailbox.ask(lambda i: mailbox.Arm(i, "anna"))


def test_two_processes_never_use_the_same_request_id(monkeypatch: pytest.MonkeyPatch) -> None:
    ids = []
    for pid in (100, 101):
        monkeypatch.setattr("os.getpid", lambda pid=pid: pid)
        flight = Flight()
        for _ in range(2):
            with pytest.raises(LinkError):
                flight.mailbox.ask(lambda i: mailbox.Arm(i, "anna"), timeout_s=0.0)
        ids += [command.request_id for command in flight.commands()]
    assert len(set(ids)) == 4


def test_the_replica_tells_no_values_before_flight_told_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("vehicle.comms.commands.FETCH_PATIENCE_S", 0.01)
    parameters = FlightParameters(Flight().mailbox, {"model.mass": 1.2})
    with pytest.raises(LinkError, match="did not report its parameters"):
        parameters.values()


def test_the_replica_gives_flights_answer() -> None:
    flight = Flight()
    parameters = FlightParameters(flight.mailbox, {})
    parameters.fetch()
    (asked,) = flight.commands()
    parameters.deliver(
        mailbox.Reply(asked.request_id, True, applied={"model.mass": 1.2}, revision=6)
    )
    assert parameters.values()["model.mass"] == 1.2
    thread = answer(flight, True, applied={"model.mass": 1.4}, revision=7)
    assert parameters.change({"model.mass": 1.4}, "anna") == ({"model.mass": 1.4}, 7)
    thread.join()
    parameters.changed(ParameterChange(1, "model.mass", 1.2, 1.4, "anna", 7))
    assert (parameters.values()["model.mass"], parameters.replica.revision) == (1.4, 7)
    thread = answer(flight, False, "in flight at most 10 % a step")
    with pytest.raises(ParameterError, match="10 % a step"):
        parameters.change({"model.mass": 2.0}, "anna")
    thread.join()
    assert parameters.values()["model.mass"] == 1.4


def test_a_new_replica_learns_what_changed_before_it_lived() -> None:
    flight = Flight()
    parameters = FlightParameters(flight.mailbox, {})
    parameters.fetch()
    (request,) = flight.commands()
    assert isinstance(request, mailbox.ChangeParameters)
    assert request.parameters == {}
    parameters.deliver(mailbox.Reply("another", True, "", {"model.mass": 2.0}, 3))
    assert not parameters.complete
    parameters.deliver(mailbox.Reply(request.request_id, True, "", {"model.mass": 1.1}, 9))
    assert now(parameters).complete
    assert (parameters.values()["model.mass"], parameters.replica.revision) == (1.1, 9)


# -------------------------------------------------------------------------------- what leaves
class FakeLog:
    """Fake onboard log, which stores its messages."""

    def __init__(self) -> None:
        self.kept: Counter[str] = Counter()

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None:
        assert type_name == TOPICS[topic].type_name
        messages.decode(payload, type_name)
        self.kept[topic] += 1


class FakeRadio:
    """Fake link, which stores its messages."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, bytes, int]] = []

    def put(self, topic: str, payload: bytes, source_ns: int) -> None:
        self.sent.append((topic, payload, source_ns))

    def count(self, topic: str) -> int:
        return sum(name == topic for name, _, _ in self.sent)

    def decoded(self, topic: str) -> list[Any]:
        type_name = TOPICS[topic].type_name
        return [messages.decode(p, type_name) for name, p, _ in self.sent if name == topic]


class Sender:
    def __init__(self, rate: float = 500.0) -> None:
        self.radio, self.log, self.rate = FakeRadio(), FakeLog(), rate
        self.station = SimpleNamespace(is_lost=False, holder=0)
        self.estimator = "complementary"
        self.publisher = Publisher(
            self.radio,
            self.log,
            VehicleClock(),
            "quad1",
            estimator=lambda: self.estimator,
            station=self.station,
            instance=7,
        )
        self.number = 0

    def ticks(self, count: int, **status: int) -> Record:
        made = np.zeros(count, TICK)
        numbers = np.arange(self.number, self.number + count)
        self.number += count
        made["sequence"] = numbers
        made["imu"]["stamp_ns"] = START_NS + (numbers * SECOND / self.rate).astype(np.int64)
        made["state"]["quaternion_wb"][:, 0] = 1.0
        made["state"]["position_w"][:, 0] = numbers
        made["status"]["tick_rate"] = self.rate
        for name, value in status.items():
            made["status"][name] = value
        return made

    def run(self, seconds: float, batch: int = 5, **status: int) -> None:
        for _ in range(round(seconds * self.rate / batch)):
            self.publisher.ticks(self.ticks(batch, **status))

    def packed(self) -> list[tuple[int, Record]]:
        return [telemetry.unpack(p) for topic, p, _ in self.radio.sent if topic == "telemetry"]


@pytest.fixture
def sender() -> Sender:
    return Sender()


@pytest.mark.parametrize("batch", [1, 4, 5, 7, 50])
def test_telemetry_holds_every_tick_once_in_order(sender: Sender, batch: int) -> None:
    for _ in range(700 // batch):
        sender.publisher.ticks(sender.ticks(batch))
    packets = sender.packed()
    assert [sequence for sequence, _ in packets] == list(range(len(packets)))
    assert {len(ticks) for _, ticks in packets} == {5}
    positions = np.concatenate([t["state"]["position_w"][:, 0] for _, t in packets])
    assert positions.tolist() == list(range(len(positions)))
    assert len(positions) >= 700 - batch - 5


@pytest.mark.parametrize(("rate", "samples"), [(60, 1), (100, 1), (260, 3), (500, 5), (650, 5)])
def test_samples_a_packet_make_about_100_packets_a_second(rate: float, samples: int) -> None:
    assert samples_a_packet(rate) == samples


def test_rates_are_those_of_the_table(sender: Sender) -> None:
    sender.run(4.0)
    for topic in ("status", "estimator", "battery", "pressure", "telemetry"):
        rate = TOPICS[topic].rate
        assert sender.radio.count(topic) == pytest.approx(4.0 * rate, abs=2), topic
    assert sender.log.kept["telemetry"] == 0


def test_all_readings_of_a_sensor_are_logged_and_fifty_a_second_sent(sender: Sender) -> None:
    judged = np.zeros(1, JUDGED_READING)
    judged["place"], judged["sensor"], judged["reading"], judged["residual"] = (
        2,
        b"height",
        1.5,
        0.5,
    )
    for k in range(1000):
        judged["stamp_ns"] = START_NS + 2 * MS * k
        sender.publisher.reading(judged)
    assert sender.log.kept["sensor_2"] == 1000
    assert sender.radio.count("sensor_2") == pytest.approx(100, abs=1)
    first = sender.radio.decoded("sensor_2")[0]
    assert (first.sensor, first.expected, first.judgement) == ("height", 1.0, 0)


def test_a_change_of_status_leaves_at_once(sender: Sender) -> None:
    sender.run(0.1)
    before = sender.radio.count("status")
    sender.publisher.ticks(sender.ticks(1, armed=1, mode=Mode.ARMED))
    assert sender.radio.count("status") == before + 1
    status = sender.radio.decoded("status")[-1]
    assert (status.mode, status.armed, status.behavior) == ("armed", True, "ground")


def test_saturation_that_comes_and_goes_is_no_change(sender: Sender) -> None:
    for k in range(500):
        sender.publisher.ticks(sender.ticks(1, flags=Flag.SATURATED if k % 2 else 0))
    assert sender.radio.count("status") <= 11


def test_a_status_follows_the_answer_to_a_command_at_once(sender: Sender) -> None:
    sender.run(1.02)  # a status was due 0.02 s ago
    before = sender.radio.count("status")
    sender.run(0.02)
    assert sender.radio.count("status") == before
    sender.publisher.answered()
    sender.run(0.02)
    assert sender.radio.count("status") == before + 1


def test_status_speaks_words(sender: Sender) -> None:
    sender.publisher.ticks(
        sender.ticks(1, behavior=BehaviorName.FLY_TO, flags=Flag.NO_POSE | Flag.LINK_LOST)
    )
    (status,) = sender.radio.decoded("status")
    assert (status.behavior, status.flags) == ("fly_to", ["no_pose", "link_lost"])
    assert flag_names(0) == []


def test_the_estimator_flown_on_is_named(sender: Sender) -> None:
    sender.run(0.1)
    sender.estimator = "mine"
    sender.run(0.1)
    names = [status.estimator for status in sender.radio.decoded("estimator")]
    assert set(names) == {"complementary", "mine"}
    assert names == sorted(names)


def test_a_lost_station_is_probed_and_the_log_keeps_all(sender: Sender) -> None:
    sender.station.is_lost = True
    sender.run(4.0)
    for topic in ("telemetry", "estimator", "pressure", "status"):
        assert 18 <= sender.radio.count(topic) <= 22, topic
    assert sender.log.kept["estimator"] == pytest.approx(200, abs=2)
    sender.station.is_lost = False
    sender.radio.sent.clear()
    sender.run(1.0)
    assert sender.radio.count("telemetry") == pytest.approx(100, abs=1)


def test_an_old_backlog_is_not_sent_as_telemetry(sender: Sender) -> None:
    sender.publisher.ticks(sender.ticks(2000))
    oldest = sender.packed()[0][1]["imu"]["stamp_ns"][0]
    newest = START_NS + 1999 * 2 * MS
    assert newest - oldest <= 200 * MS


def test_events_leave_even_when_the_station_is_lost(sender: Sender) -> None:
    sender.station.is_lost = True
    for k in range(3):
        sender.publisher.event(mailbox.Event(START_NS + k, mailbox.WARN, f"line {k}"))
    assert [log.msg for log in sender.radio.decoded("events")] == ["line 0", "line 1", "line 2"]
    assert sender.log.kept["events"] == 3


def test_a_parameter_change_has_its_values_and_who_counts(sender: Sender) -> None:
    sender.publisher.parameter_change(ParameterChange(START_NS, "model.mass", 1.3, 1.4, "anna", 2))
    (change,) = sender.radio.decoded("parameter_changes")
    assert (change.name, change.revision, change.instance) == ("model.mass", 2, 7)
    assert (change.old_value.double_value, change.new_value.double_value) == (1.3, 1.4)
    sender.run(0.2)
    assert {status.instance for status in sender.radio.decoded("status")} == {7}


# -------------------------------------------------------------------------------- what comes in
class Receiver:
    def __init__(self, fake_time: FakeTime) -> None:
        self.time, self.flight, self.clock = fake_time, Flight(), VehicleClock()
        self.clock.observe(START_NS, fake_time.monotonic)
        self.said: list[str] = []
        self.poses: list[tuple[bytes, int]] = []
        self.logged: list[str] = []
        self.inbound = Inbound(
            self.flight.mailbox,
            self.clock,
            lambda level, text: self.said.append(text),
            lambda payload, stamp: self.poses.append((payload, stamp)),
            lambda topic, payload, stamp: self.logged.append(topic),
        )
        self.inbound.prepare().join(60.0)

    def pose(self, age_ns: int) -> None:
        sample = np.zeros(1, POSE_SAMPLE)
        sample["stamp_ns"] = self.clock.now_ns() - age_ns
        sample["position_w"] = (1.0, 2.0, 3.0)
        sample["quaternion_wb"] = (0.0, 1.0, 0.0, 0.0)
        self.inbound.handle("tracker_pose", pose_messages(sample).tobytes())

    def bearings(self, position_w: np.ndarray, ids: list[int], age_ns: int = 0) -> None:
        places = dict(zip(PAPER_BEACONS.ids.tolist(), PAPER_BEACONS.positions_w, strict=True))
        lines = np.array([places.get(i, np.zeros(3)) - position_w for i in ids])
        lines /= np.linalg.norm(lines, axis=1)[:, None]
        payload = encode_bearings(self.clock.now_ns() - age_ns, ids, lines, 0.02)
        self.inbound.handle("bearings", payload)


@pytest.fixture
def receiver(fake_time: FakeTime) -> Receiver:
    return Receiver(fake_time)


def test_a_fresh_pose_reaches_flight_and_log(receiver: Receiver) -> None:
    receiver.pose(age_ns=30 * MS)
    stamp = START_NS - 30 * MS
    (pose,) = receiver.flight.measured()
    assert pose.tobytes() == pose_sample(stamp, (1.0, 2.0, 3.0), (0.0, 1.0, 0.0, 0.0)).tobytes()
    assert receiver.logged == ["tracker_pose"]


def test_the_position_of_a_marker_reaches_flight_and_log(receiver: Receiver) -> None:
    sent = pose_sample(START_NS - 30 * MS, (1.0, 2.0, 3.0), NO_ATTITUDE)
    receiver.inbound.handle("tracker_position", position_messages(sent).tobytes())
    (taken,) = receiver.flight.measured()
    assert taken.tobytes() == sent.tobytes()
    assert receiver.logged == ["tracker_position"]


@pytest.mark.parametrize(
    ("age_ms", "words"), [(201, "201 ms old"), (-201, "201 ms ahead"), (99_000, "99000 ms old")]
)
def test_what_is_not_of_now_is_ignored(receiver: Receiver, age_ms: int, words: str) -> None:
    receiver.pose(age_ns=age_ms * MS)
    assert receiver.flight.measured() == []
    assert receiver.logged == []
    assert len(receiver.said) == 1
    assert words in receiver.said[0]


@pytest.mark.parametrize("age_ms", [-200, 0, 200])
def test_200_ms_are_allowed(receiver: Receiver, age_ms: int) -> None:
    receiver.pose(age_ns=age_ms * MS)
    assert len(receiver.flight.measured()) == 1


def test_complaints_come_once_in_five_seconds_with_their_number(receiver: Receiver) -> None:
    for _ in range(50):
        receiver.pose(age_ns=SECOND)
    assert len(receiver.said) == 1
    receiver.time.monotonic += 5 * SECOND
    receiver.pose(age_ns=SECOND)
    assert receiver.said[1].endswith("(and 49 more)")


def test_sticks_reach_flight(receiver: Receiver) -> None:
    payload = encode_joy(START_NS, (0.5, 0.0, -0.25, 0.0), True)
    receiver.inbound.handle("joy", payload)
    assert receiver.flight.received() == [mailbox.Joy(START_NS, (0.5, 0.0, -0.25, 0.0), True)]


HALF = (0.5, 0.0, 0.0, 0.0)


def sticks(
    receiver: Receiver, axes: tuple[float, ...] = HALF, held: bool = True, by: bytes = b"node"
) -> bool:
    """Send sticks; return whether they reached flight."""
    payload = encode_joy(receiver.clock.now_ns(), axes, held)
    receiver.inbound.handle("joy", payload, by)
    return bool(receiver.flight.received())


def silence(receiver: Receiver, milliseconds: int) -> None:
    receiver.time.monotonic += milliseconds * MS
    receiver.inbound.report_silence()


@pytest.mark.parametrize(("axes", "held"), [((0.1, 0.0, -0.14, 0.0), True), (HALF, False)])
def test_held_sticks_that_were_silent_must_be_at_rest_before_they_count(
    receiver: Receiver, axes: tuple[float, ...], held: bool
) -> None:
    assert sticks(receiver)
    silence(receiver, 501)
    silence(receiver, 501)
    assert receiver.said == [
        "joy: silent for 0.5 s while held; they count again once they are released or centred"
    ]
    assert not sticks(receiver)
    silence(receiver, 5000)
    assert not sticks(receiver)
    assert receiver.said[1].startswith("joy: silent"), "of those that did not count, too"
    assert sticks(receiver, axes, held)
    assert sticks(receiver)


def test_a_short_break_of_held_sticks_and_the_silence_of_released_ones_change_nothing(
    receiver: Receiver,
) -> None:
    assert sticks(receiver)
    silence(receiver, 500)
    assert sticks(receiver)
    assert sticks(receiver, held=False)
    silence(receiver, 9000)
    assert receiver.said == []
    assert sticks(receiver)


def test_the_sticks_of_another_sender_must_be_at_rest_before_they_count(receiver: Receiver) -> None:
    assert sticks(receiver, held=False)
    silence(receiver, 1500)
    assert not sticks(receiver, by=b"another node")
    assert receiver.said == [
        "joy: ignored after a silence, or from another sender than before; "
        "they count again once they are released or centred"
    ]
    assert sticks(receiver, (0.0, 0.0, 0.0, 0.0), by=b"another node")
    assert sticks(receiver, by=b"another node")


def reference(age_ns: int = 0, frame: str = "world", **fields: object) -> bytes:
    told = {"header": messages.header(START_NS - age_ns, frame), **fields}
    return messages.encode(messages.new("quadlab_msgs/Reference", **told))


@pytest.mark.parametrize("frame", ["world", ""])
def test_a_reference_of_a_ros_node_reaches_flight_and_log(receiver: Receiver, frame: str) -> None:
    payload = reference(10 * MS, frame, position={"x": 1.0, "y": 2.0, "z": 3.0}, yaw=0.5)
    receiver.inbound.handle("external_reference", payload, b"node")
    numbers = (1.0, 2.0, 3.0, *(12 * [0.0]), 0.5, 0.0, 0.0)
    assert receiver.flight.received() == [mailbox.ExternalReference(START_NS - 10 * MS, numbers)]
    assert receiver.logged == ["external_reference"]
    receiver.inbound.handle("external_reference", payload, b"another node")
    assert receiver.flight.received() == []
    assert receiver.said == [], "the node may only have been started anew"
    receiver.inbound.handle("external_reference", payload, b"node")
    assert len(receiver.flight.received()) == 1
    receiver.inbound.handle("external_reference", payload, b"another node")
    assert receiver.flight.received() == []
    assert receiver.said == [
        "external_reference: a second sender is ignored; stop one of the two (station, ROS 2 node)"
    ]


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        (reference(201 * MS), "201 ms old"),
        (reference(yaw=math.nan), "not finite; send zeros instead"),
        (reference(snap={"x": 0.0, "y": math.inf, "z": 0.0}), "not finite"),
        (reference(frame="map"), "in the frame 'map'; send it in 'world'"),
        (b"\0\1\0\0", "external_reference: "),
    ],
)
def test_a_reference_that_cannot_be_flown_is_said_and_left(
    receiver: Receiver, payload: bytes, said: str
) -> None:
    receiver.inbound.handle("external_reference", payload)
    assert (receiver.flight.received(), receiver.logged) == ([], [])
    assert len(receiver.said) == 1
    assert said in receiver.said[0]


def test_a_second_station_is_reported_and_one_that_was_started_anew_is_not(
    receiver: Receiver,
) -> None:
    for instance in (1 << 40, 2 << 40, 2 << 40):  # the first one has ended
        receiver.inbound.handle("station_heartbeat", encode_heartbeat(1, 0, instance))
    assert receiver.said == ["base station connected"]
    for instance in (1 << 40, 2 << 40):  # it has not
        receiver.inbound.handle("station_heartbeat", encode_heartbeat(1, 0, instance))
    assert receiver.said[1:] == [
        "station_heartbeat: station 000002 is ignored: station 000001 controls this vehicle; stop "
        "one of the two"
    ]


def test_a_heartbeat_counts_when_it_comes_whatever_its_stamp(receiver: Receiver) -> None:
    assert receiver.inbound.station_silence == float("inf")
    receiver.inbound.handle("station_heartbeat", encode_heartbeat(1, 12345))
    assert receiver.flight.received() == [mailbox.Heartbeat(START_NS)]
    receiver.time.monotonic += SECOND
    assert receiver.inbound.station_silence == 1.0


def test_what_a_vehicle_does_while_comms_starts_anew_is_told_once_a_station_is_there(
    receiver: Receiver,
) -> None:
    ignore = lambda *_: None  # noqa: E731
    again = Inbound(receiver.flight.mailbox, receiver.clock, ignore, ignore, ignore, resumes=True)
    deferred, braking = DeferredEvents(), mailbox.Event(1, mailbox.WARN, "braking: a")
    assert not deferred.defer(braking, receiver.inbound.station_silence), "no station, ever"
    assert deferred.defer(braking, again.station_silence)


def test_four_bearings_give_the_pose(receiver: Receiver) -> None:
    position = np.array([0.3, -0.2, 1.4])
    receiver.bearings(position, [1, 2, 3, 4])
    ((payload, stamp),) = receiver.poses
    pose = messages.decode(payload, "geometry_msgs/PoseWithCovarianceStamped").pose
    found = (pose.pose.position.x, pose.pose.position.y, pose.pose.position.z)
    assert found == pytest.approx(position, abs=1e-6)
    assert abs(pose.pose.orientation.w) == pytest.approx(1.0, abs=1e-6)
    assert stamp == START_NS
    (bearings,) = receiver.flight.measured()
    assert bearings["beacon_id"][: bearings["count"]].tolist() == [1, 2, 3, 4]


def test_an_unknown_beacon_is_left_out(receiver: Receiver) -> None:
    receiver.bearings(np.array([0.3, -0.2, 1.4]), [1, 9, 2, 3, 4])
    assert len(receiver.poses) == 1


@pytest.mark.parametrize(("age_ns", "used"), [(LATEST_NS, 1), (LATEST_NS + MS, 0), (-201 * MS, 0)])
def test_bearings_may_be_as_late_as_a_filter_can_use_them(
    receiver: Receiver, age_ns: int, used: int
) -> None:
    receiver.bearings(np.array([0.3, -0.2, 1.4]), [1, 2, 3, 4], age_ns)
    assert len(receiver.flight.measured()) == used
    assert len(receiver.said) == 1 - used


@pytest.mark.parametrize("ids", [[1, 2], [8, 9]])
def test_too_few_bearings_are_said_and_still_reach_flight(
    receiver: Receiver, ids: list[int]
) -> None:
    for _ in range(3):
        receiver.bearings(np.array([0.3, -0.2, 1.4]), ids)
    assert receiver.poses == []
    assert len(receiver.said) == 1
    assert receiver.said[0].startswith("bearings: ")
    assert len(receiver.flight.measured()) == 3


def test_rubbish_is_said_and_harms_nothing(receiver: Receiver) -> None:
    for topic in receiver.inbound.handlers:
        receiver.inbound.handle(topic, b"\x00\x01\x00\x00rubbish")
    assert (receiver.flight.received(), receiver.flight.measured()) == ([], [])
    assert len(receiver.said) == len(receiver.inbound.handlers)
