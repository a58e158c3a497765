"""Signals have their defined values, and every tick reaches a page that asks for it, once."""

from __future__ import annotations

import asyncio
import json
import math
import struct
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import websockets.exceptions

from benchmarks.page.live_frames import read
from quadrotor.records import Record
from tests.support.live_signals import Received, packets_of, ticks_of
from vehicle_link import clock
from vehicle_link.lockstep import Page
from vehicle_link.messages import new
from web.latest import STALE, TICKS
from web.live import events, frames
from web.live.telemetry import (
    AT_ONCE,
    MOST_KEPT,
    MOST_SIGNALS,
    Ping,
    Series,
    Subscription,
    _Page,
    parse_request,
)
from web.live.topic_logs import KEPT
from web.signals import INDEX, SIGNALS, describe

QUARTER = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # w, x, y, z: 90 degrees of yaw
X = "state.position.x"


def test_names_are_unique_and_every_topic_has_an_age() -> None:
    assert len(INDEX) == len(SIGNALS)
    assert {signal.topic for signal in SIGNALS} <= STALE.keys()
    assert describe()["topics"] == list(STALE)


def test_velocity_and_yaw_are_in_world_axes() -> None:
    received, ticks = Received(), ticks_of(1)
    ticks["state"]["position_w"] = (1.0, 2.0, 3.0)
    ticks["state"]["quaternion_wb"] = QUARTER
    ticks["state"]["velocity_w"] = (-0.5, 2.0, 0.25)
    received.ticks(ticks)
    now = received.newest()
    assert [now[f"state.position.{a}"] for a in "xyz"] == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(
        [now[f"state.velocity.{a}"] for a in "xyz"], [-0.5, 2.0, 0.25], atol=1e-6
    )
    assert now["state.yaw"] == pytest.approx(90.0)


def test_angles_are_those_of_known_rotations() -> None:
    from quadrotor.plain_rotations import roll_pitch_yaw
    from web.view.shapes import wxyz_of

    half = math.radians(10.0)
    for axis, index in (("x", 0), ("y", 1), ("z", 2)):
        q = new("geometry_msgs/Quaternion", w=math.cos(half), **{axis: math.sin(half)})
        expected = [0.0, 0.0, 0.0]
        expected[index] = math.radians(20.0)
        np.testing.assert_allclose(roll_pitch_yaw(*wxyz_of(q)), expected, atol=1e-12)


def test_the_tracking_error_is_state_minus_reference_of_the_same_tick() -> None:
    received, ticks = Received(), ticks_of(500)
    random = np.random.default_rng(1)
    moving = np.cumsum(random.normal(0.0, 0.01, (500, 3)), axis=0)  # 5 m/s
    ticks["state"]["position_w"] = moving + np.array([0.0, 0.0015, 0.002])
    ticks["state"]["quaternion_wb"] = QUARTER
    ticks["reference"]["position_w"], ticks["reference"]["yaw"] = moving, math.pi
    received.ticks(ticks)
    np.testing.assert_allclose(received.samples("error.distance"), 2.5, atol=1e-3)
    np.testing.assert_allclose(received.samples("error.yaw"), -90.0, atol=1e-4)


def test_an_input_of_another_topic_is_interpolated_and_waited_for() -> None:
    received, truth = Received(), "truth.position_error"
    ticks = ticks_of(101, rate=100.0)
    ticks["state"]["position_w"][:, 0] = 0.01 * np.arange(101)  # 1 m/s
    message = new("nav_msgs/Odometry", pose={"pose": {"orientation": (0.0, 0.0, 0.0, 1.0)}})
    received.ticks(ticks[:51])
    for time in (0.105, 0.495, 0.505):
        message.pose.pose.position.x = time
        received.put("truth", message, time)
    np.testing.assert_allclose(received.samples(truth), 0.0, atol=1e-3)
    assert len(received.samples(truth)) == 2, "the third is not between two ticks yet"
    received.ticks(ticks[51:])
    np.testing.assert_allclose(received.samples(truth), 0.0, atol=1e-3)
    assert len(received.samples(truth)) == 3


def test_what_an_input_never_had_is_no_number_after_its_deadline() -> None:
    received = Received()
    received.ticks(ticks_of(2))
    message = new("nav_msgs/Odometry", pose={"pose": {"orientation": (0.0, 0.0, 0.0, 1.0)}})
    received.put("truth", message, 0.010)
    received.ticks(ticks_of(1, start=1.0))  # a hole longer than the deadline of the state
    received.put("truth", message, 1.010)
    assert np.isnan(received.samples("truth.position_error")).tolist() == [True]
    received.clock.now += 1.0
    assert np.isnan(received.samples("truth.position_error")).tolist() == [True, True]


def page(*series: Series, signals: list[str] | None = None, origin: float = 0.0) -> _Page:
    return _Page(Subscription(1, signals or [], list(series), origin))


def flight(count: int) -> Record:
    ticks = ticks_of(count)
    ticks["state"]["position_w"][:, 0] = np.random.default_rng(2).normal(0.0, 0.1, count)
    return ticks


def test_every_tick_reaches_a_page_once_with_its_stamp() -> None:
    received, looking = Received(), page(Series([X, "error.position.x"]), signals=["thrust"])
    ticks, times, values = flight(400), [], []
    for k in range(0, 400, 20):
        for packet in packets_of(ticks[k : k + 20]):
            received.live.put(TICKS, packet, 1)
        received.feed.step()
        frame = read(received.feed.frame(looking), ["thrust"], [[X, "error.position.x"]])
        times += frame.series[0].time.tolist()
        values += frame.series[0].values[X].tolist()
    stamps = [round(1e9 * t) + received.log.origin_ns for t in times]
    assert stamps == ticks["imu"]["stamp_ns"].tolist()
    assert values == ticks["state"]["position_w"][:, 0].astype(np.float32).tolist()
    assert frame.newest == {"thrust": 0.0}
    assert frame.now == pytest.approx(times[-1])
    assert read(received.feed.frame(looking), ["thrust"], [[X]]).series == {}


@pytest.mark.parametrize("slowness", [1, 8])
def test_lost_ticks_are_a_hole_with_their_number(slowness: int) -> None:
    received, ticks = Received(), flight(300)
    ticks["state"]["position_w"][60, 0] = 3.0
    received.ticks(ticks[:100])
    received.ticks(ticks[115:200])
    looking = page(Series([X]))
    looking.slowness = slowness
    [first] = read(received.feed.frame(looking), [], [[X]]).series.values()
    received.ticks(ticks[205:])  # lost between two frames
    [second] = read(received.feed.frame(looking), [], [[X]]).series.values()
    assert [n for _, n in first.holes] == [15.0]
    assert [n for _, n in second.holes] == [5.0]
    for one in (first, second):
        [[at, _]] = one.holes
        assert one.time[np.isnan(one.values[X])].tolist() == [at]
        assert (np.diff(one.time) >= 0.0).all()
    assert np.nanmax(first.values[X]) == 3.0


def test_a_page_that_comes_back_gets_what_it_missed_and_no_spike_is_lost() -> None:
    received, ticks = Received(), flight(170_000)  # 5.7 min
    ticks["state"]["position_w"][20_000, 0] = 9.0  # of one tick
    received.ticks(ticks)
    origin = 1e-9 * received.log.origin_ns
    looking = page(Series([X], after=10.0), origin=origin)
    found, most = [], 0.0
    while parts := read(received.feed.frame(looking), [], [[X]]).series:
        found += parts[0].time.tolist()
        most = max(most, float(np.nanmax(parts[0].values[X])))
        assert not parts[0].holes
    assert found[0] > 10.0
    assert found[-1] == received.times()[-1]
    assert np.diff(found).max() < 128 / 500.0
    assert np.diff(found[-6000:]).max() == pytest.approx(0.002, abs=1e-6)
    assert most == 9.0
    assert len(found) < 30_000


def test_everything_older_than_ten_minutes_is_given_up() -> None:
    received = Received()
    for start in (0.0, 300.0, 700.0):
        received.ticks(ticks_of(100, start=start))
        received.put("battery", new("sensor_msgs/BatteryState", voltage=start), start + 0.1)
    times = received.times()
    assert len(times) == 200
    assert times[-1] - times[0] < KEPT
    assert received.samples("battery.voltage") == [300.0, 700.0]


def test_a_vehicle_that_restarts_begins_anew() -> None:
    told: list[str] = []
    received = Received(began_anew=lambda: told.append("anew"))
    received.ticks(ticks_of(100, start=1000.0))
    looking = page(Series([X]))
    before = read(received.feed.frame(looking), [], [[X]])
    assert len(before.series[0].time) == 100
    received.ticks(ticks_of(50))
    after = read(received.feed.frame(looking), [], [[X]])
    assert after.origin == before.origin - 1000.0
    assert len(after.series[0].time) == 50
    assert told == ["anew"]


def test_stamps_that_jump_are_a_hole_and_late_ones_change_nothing() -> None:
    received = Received()
    received.ticks(ticks_of(100))
    received.ticks(ticks_of(100, start=60.0))
    received.ticks(ticks_of(10, start=59.0))  # late
    [part] = read(received.feed.frame(page(Series([X]))), [], [[X]]).series.values()
    [[_, missing]] = part.holes
    assert missing == pytest.approx(29_900, abs=1)
    assert len(part.time) == 201


def test_a_simulation_that_pauses_makes_no_hole() -> None:
    received, ticks = Received(), flight(200)
    received.ticks(ticks[:100])
    now = received.log.now
    received.clock.now += 0.0  # the simulation's clock stands still, whatever the computer's does
    assert received.log.now == now
    received.ticks(ticks[100:])
    [part] = read(received.feed.frame(page(Series([X]))), [], [[X]]).series.values()
    assert (len(part.time), part.holes) == (200, [])


def test_messages_that_arrive_late_keep_their_stamps() -> None:
    received = Received()
    received.ticks(ticks_of(100))
    received.put("battery", new("sensor_msgs/BatteryState", voltage=15.0), 0.1)
    received.ticks(ticks_of(100, start=40.0))  # of a process that stood still for 40 s
    received.put("battery", new("sensor_msgs/BatteryState", voltage=14.0), 9.0)
    log = received.log.log("battery")
    assert log is not None
    np.testing.assert_allclose(log.time - log.time[0], [0.0, 8.9])


def test_ticks_that_arrive_late_fill_the_charts_and_are_not_the_newest_state() -> None:
    received = Received()
    assert received.live.newest("state") is None
    for packet in packets_of(ticks_of(5)):
        received.live.put(TICKS, packet, 0)
    received.log.take()
    assert math.isinf(received.live.age("state"))
    assert len(received.samples(X)) == 5


def test_a_derived_signal_has_a_sample_for_each_tick_and_goes_on_where_it_was() -> None:
    received, name = Received(), "distance [m] = integral(state.velocity.x)"
    ticks = ticks_of(1000)
    ticks["state"]["velocity_w"][:, 0] = 2.0
    looking = page(Series([name]))
    received.feed._pages[None] = looking  # type: ignore[index]
    found: list[float] = []
    for k in range(0, 1000, 50):
        for packet in packets_of(ticks[k : k + 50]):
            received.live.put(TICKS, packet, 1)
        received.feed.step()
        found += read(received.feed.frame(looking), [], [[name]]).series[0].values[name].tolist()
    np.testing.assert_allclose(found, 0.004 * np.arange(1000), atol=1e-6)
    assert received.feed.topics == {"state"}


def test_a_signal_that_the_vehicle_has_not_is_no_number() -> None:
    received, names = Received(), ["pressure.fluid_pressure", "battery.voltage"]
    received.ticks(ticks_of(10))
    looking = page(Series(names[:1]), Series(names[1:]), signals=names)
    frame = read(received.feed.frame(looking), names, [names[:1], names[1:]])
    assert frame.series == {}
    assert all(math.isnan(one) for one in frame.newest.values())
    assert frame.ages == {"battery": math.inf, "pressure": math.inf}


def test_a_frame_has_a_bounded_number_of_samples_of_all_series() -> None:
    received, names = Received(), [[X]] * MOST_SIGNALS
    received.ticks(ticks_of(6000))
    looking, sent = page(*(Series(one) for one in names)), [0] * MOST_SIGNALS
    looking.is_behind = True
    while looking.is_behind:
        series = read(received.feed.frame(looking), [], names).series
        assert 0 < len(series) <= AT_ONCE // 6000 + 1
        for place, part in series.items():
            sent[place] += len(part.time)
    assert sent == [6000] * MOST_SIGNALS


def test_a_page_that_reads_slowly_gets_coarser_series_and_is_told() -> None:
    received, looking = Received(), page(Series([X]))
    received.ticks(flight(3000))
    for _ in range(4):
        looking.sent(1.0)
    frame = read(received.feed.frame(looking), [], [[X]])
    assert frame.slowness == frame.series[0].of == 32
    assert len(frame.series[0].time) == pytest.approx(3 * 3000 / 32, abs=3)
    for _ in range(1000):
        looking.sent(0.0)
    assert looking.slowness == 1


def test_what_is_not_asked_for_is_not_sent() -> None:
    received = Received()
    received.ticks(ticks_of(100))
    assert len(received.feed.frame(page())) == frames.HEAD.size


def test_the_default_page_costs_less_than_40_kilobytes_a_second() -> None:
    received = Received()
    received.ticks(ticks_of(20))
    charted = [*(f"{of}.position.{a}" for of in ("state", "error") for a in "xyz")]
    reference = [f"reference.position.{a}" for a in "xyz"]
    shown = [signal.name for signal in SIGNALS[:40]]
    frame = received.feed.frame(page(Series(charted), Series(reference), signals=shown))
    assert 25 * (len(frame) + 4) < 40_000


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"id": 1}',
        '{"ping": "now"}',
        '{"ping": 1, "id": 2}',
        '{"id": 1, "signals": ["no.such"]}',
        '{"id": 1, "signals": ["= abs(no.such)"]}',
        '{"id": -1, "signals": []}',
        '{"id": 70000, "signals": []}',
        '{"id": 1, "signals": [3]}',
        json.dumps({"id": 1, "signals": ["thrust"] * (MOST_SIGNALS + 1)}),
        json.dumps({"id": 1, "signals": [], "series": [{"signals": ["thrust"] * 10_000}]}),
        '{"id": 1, "signals": [], "series": [{"signals": []}]}',
        '{"id": 1, "signals": [], "series": [{"signals": ["no.such"]}]}',
    ],
)
def test_a_bad_subscription_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_request(text)


def test_frames_follow_the_subscription(site: Any, operator: httpx.Client, station: Any) -> None:
    names, series = [X, "mass", "thrust"], [["state.position.y"]]
    with site.websocket("/ws/telemetry", site.cookie(operator)) as page:
        asked = {"id": 9, "signals": names, "series": [{"signals": one} for one in series]}
        page.send(json.dumps(asked))
        while True:
            station.fly(x=1.25, y=0.5)
            raw = page.recv(timeout=10.0)
            if struct.unpack_from("<H", raw) == (9,):
                found = read(raw, names, series)
                if found.series and found.newest[X] == 1.25:  # not of the test before
                    break
        assert list(found.ages) == ["state", "actuators", "estimator"]
        np.testing.assert_allclose(list(found.newest.values()), (1.25, 1.31, 12.8))
        assert set(found.series[0].values["state.position.y"].tolist()) <= {0.5, 2.0}
        page.send(json.dumps({"id": 10, "signals": ["no.such"]}))
        with pytest.raises(websockets.exceptions.ConnectionClosed, match="unknown signal"):
            drain(page)


def test_a_derived_signal_comes_in_the_frames_and_a_wrong_one_says_why(
    site: Any, operator: httpx.Client, station: Any
) -> None:
    texts = ["twice [kg] = 2*mass", "= integral(mass)", "= abs(no.such)"]
    twice, rate, wrong = operator.get("/api/expressions", params={"text": texts}).json()
    assert (twice["label"], twice["unit"], twice["topic"]) == ("twice", "kg", "estimator")
    assert "no signal no.such" in wrong["problem"]
    names = [twice["name"], rate["name"], "thrust"]
    with site.websocket("/ws/telemetry", site.cookie(operator)) as page:
        page.send(json.dumps({"id": 9, "signals": names}))
        sums: list[float] = []
        while len(set(sums)) < 3:
            station.fly()
            raw = page.recv(timeout=10.0)
            if struct.unpack_from("<H", raw) != (9,):
                continue
            found = list(read(raw, names).newest.values())
            if np.isfinite(found).all():
                assert found[0] == pytest.approx(2 * 1.31)
                sums.append(found[1])
    assert sums == sorted(sums)


class Stalled:
    """A websocket of a page that does not read until it is `released`."""

    def __init__(self, asked: str) -> None:
        self._asked: asyncio.Queue[Any] = asyncio.Queue()
        self._asked.put_nowait({"type": "websocket.receive", "text": asked})
        self.sending, self.released = asyncio.Event(), asyncio.Event()
        self.frames: list[bytes] = []

    async def accept(self) -> None: ...

    async def receive(self) -> Any:
        return await self._asked.get()

    async def send_bytes(self, data: bytes) -> None:
        self.frames.append(data)
        self.sending.set()
        await self.released.wait()

    def leave(self) -> None:
        self._asked.put_nowait({"type": "websocket.disconnect"})


def test_nothing_waits_for_a_page_that_does_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("web.live.telemetry.RATE", 1e4)
    received, asked = Received(), {"id": 1, "signals": [], "series": [{"signals": [X]}]}

    async def converse() -> list[bytes]:
        page = Stalled(json.dumps(asked))
        loops = [
            asyncio.create_task(received.feed.run()),
            asyncio.create_task(received.feed.serve(page)),  # type: ignore[arg-type]
        ]
        await asyncio.wait_for(page.sending.wait(), 10.0)
        for k in range(500):
            for packet in packets_of(ticks_of(20, start=0.04 * k)):
                received.live.put(TICKS, packet, 1)
            await asyncio.sleep(0.0)
        assert len(page.frames) == 1
        page.released.set()
        while len(page.frames) < 4:
            await asyncio.sleep(0.0)
        page.leave()
        await loops[1]
        loops[0].cancel()
        return page.frames

    parts = [
        part
        for raw in asyncio.run(converse())
        for part in (read(raw, [], [[X]]).series if raw[:2] == b"\1\0" else {}).values()
    ]
    assert parts[-1].time[-1] == received.times()[-1]
    assert sum(len(one.time) for one in parts) < 8000


def test_a_page_that_asks_for_ever_other_signals_leaves_little_to_compute() -> None:
    received = Received()
    received.ticks(ticks_of(500))
    for k in range(20):
        names = [f"= {k}+{j}*{X}" for j in range(MOST_SIGNALS)]
        received.feed._pages = {None: page(signals=names)}  # type: ignore[dict-item]
        received.feed.step()
    assert len(received.log._kept) == MOST_SIGNALS
    assert received.log.formed(names[0]) == 500
    assert received.log._kept.keys() == set(names)
    assert len(received.feed._asked) == MOST_KEPT
    received.feed._pages = {}
    received.clock.now += KEPT + 1.0
    received.feed.step()
    assert not received.log._kept
    assert not received.feed._asked


def test_pages_that_missed_all_get_it_in_turns() -> None:
    """Other work of the event loop comes between any two of their frames."""
    received, asked = Received(), {"id": 1, "signals": [], "series": [{"signals": [X]}]}
    received.ticks(ticks_of(500))

    async def converse() -> list[int]:
        pages = [Stalled(json.dumps(asked)) for _ in range(50)]
        clock = asyncio.create_task(received.feed.run())
        loops = [
            asyncio.create_task(received.feed.serve(page))  # type: ignore[arg-type]
            for page in pages
        ]
        begun = [0]
        while begun[-1] < len(pages):
            await asyncio.sleep(0.0)
            begun.append(sum(bool(page.frames) for page in pages))
        for page in pages:
            page.leave()
        await asyncio.wait_for(asyncio.gather(*loops), 10.0)
        clock.cancel()
        return begun

    assert max(np.diff(asyncio.run(converse()))) == 1


def test_a_page_can_time_its_own_link(site: Any, operator: httpx.Client) -> None:
    assert parse_request('{"ping":12.5}') == Ping(12.5)
    with site.websocket("/ws/telemetry", site.cookie(operator)) as page:
        page.send('{"ping":12.5}')
        while not isinstance(answer := page.recv(timeout=10.0), str):
            pass
    assert json.loads(answer) == {"pong": 12.5}


def drain(page: Any) -> None:
    while True:
        page.recv(timeout=10.0)


def test_the_summary_tells_status_and_ages(site: Any, operator: httpx.Client, station: Any) -> None:
    station.fly()
    summary = operator.get("/api/summary").json()
    assert summary["status"]["mode"] == "armed"
    assert summary["status"]["flags"] == ["not_real_time"]
    assert summary["status"]["lateness_p99"] == pytest.approx(1.4e-4)
    assert summary["link"]["loss"] == pytest.approx(0.02)
    assert summary["battery"]["voltage"] == pytest.approx(15.6, abs=0.01)
    assert summary["age"]["state"] < 5.0


def test_the_real_time_factor_is_told_while_the_station_is_waited_for(
    site: Any, operator: httpx.Client, station: Any, tmp_path: Path
) -> None:
    page = Page(["quad1"], tmp_path)
    clock.follow(page.path)
    try:
        station.fly()
        operator.get("/api/summary")
        words = clock.page()
        assert words is not None
        words[clock.LIMIT], words[clock.FACTOR] = clock.monotonic_ns(), 40_000
        summary = operator.get("/api/summary").json()
        assert summary["station"]["real_time_factor"] == pytest.approx(0.04)
    finally:
        clock.follow(None)
        page.close()


def test_a_new_page_gets_the_lines_before_it(site: Any, operator: httpx.Client) -> None:
    site.station._hub.publish_from_thread(
        {"type": "event", "level": "warn", "text": "battery low", "source": "quad1", "stamp": 1.0}
    )
    while not operator.get("/api/events").json():
        pass
    with site.websocket("/ws/events", site.cookie(operator)) as page:
        hello = json.loads(page.recv(timeout=10.0))
    assert hello["type"] == "hello"
    assert hello["vehicle"] == "quad1"
    assert "battery low" in [line["text"] for line in hello["events"]]


def test_a_summary_asked_for_does_not_wait_for_the_next(
    site: Any, operator: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(events, "RATE", 1e-3)
    with site.websocket("/ws/events", site.cookie(operator)) as page:
        assert json.loads(page.recv(timeout=10.0))["type"] == "hello"
        assert json.loads(page.recv(timeout=10.0))["type"] == "summary"
        site.station._hub.publish_from_thread(events.SUMMARY_NOW)
        kind = ""
        while kind != "summary":  # parameters may arrive in between; the next is 1000 s away
            kind = json.loads(page.recv(timeout=10.0))["type"]
