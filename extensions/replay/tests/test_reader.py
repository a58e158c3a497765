"""A replay shows the recorded data: each sample when zoomed in, extremes when zoomed out."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.logs.recorded_run import STEP_NS, MadeRun, position_at, write_run
from extensions.replay import timeline
from extensions.replay.build import build_replay
from extensions.replay.reader import Replay
from extensions.replay.samples import BIN, coarser
from extensions.replay.track import PARTS, WIDTH
from flight_log import LogWriter, read_log
from flight_log.run import common_stamps, gaps
from quadrotor.errors import LogFormatError, MeasurementError, OutOfBoundsError
from vehicle_link.messages import decode, encode, header, new, time_message
from vehicle_link.topics.measurements import PICTURE, encode_bearings, encode_picture
from web.signals import NAMED_SOURCES

RUN = MadeRun(
    24.0,
    silence=(11.0, 12.5),
    marks=[(13.0, "gust"), (14.5, "")],
    changes=[(9.0, "control.position.kp_xy", 4.0, 5.5)],
    keep_out="pillar 1 1.4 -1 1 0 2",
)
HEIGHT = ["state.position.z"]
SECOND = 10**9


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("runs") / "a.mcap", RUN)


def test_a_log_of_more_messages_than_are_held_is_refused(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flight_log.run.MAX_MESSAGES", 1000)
    with pytest.raises(LogFormatError, match="at most 1000 are shown"):
        build_replay(log, lambda share: None)


@pytest.fixture(scope="module")
def replay(log: Path) -> Replay:
    told: list[float] = []
    build_replay(log, told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0
    return Replay(log)


def shown(log: Path) -> Replay:
    build_replay(log, lambda share: None)
    return Replay(log)


@pytest.fixture(scope="module")
def samples(log: Path) -> tuple[Any, Any]:
    """Return times (s) and heights (m) of the state, read by the message decoder."""
    found = []
    for message in read_log(log, topics=["/quad1/state"]):
        height = decode(message.payload, "nav_msgs/Odometry").pose.pose.position.z
        found.append((message.publish_ns, height))
    stamps, heights = zip(*found, strict=True)
    times = (np.array(stamps) - stamps[0]) / 1e9
    return times, np.array(heights)


def unpacked(data: bytes) -> list[tuple[list[str], Any, list[Any]]]:
    """Return the groups of a window: signals, times, a column each."""
    (length,) = struct.unpack_from("<I", data)
    head, at, found = json.loads(data[4 : 4 + length]), 8 * math.ceil((4 + length) / 8), []
    for group in head["groups"]:
        count = group["count"]
        times = np.frombuffer(data, "<f8", count, at)
        at += 8 * count
        columns = []
        for _ in group["signals"]:
            columns.append(np.frombuffer(data, "<f4", count, at))
            at += 8 * math.ceil(4 * count / 8)
        found.append((group["signals"], times, columns))
    assert at == len(data)
    return found


# ---------------------------------------------------------------------- windows
def test_near_by_a_window_holds_every_sample(replay: Replay, samples: tuple[Any, Any]) -> None:
    times, heights = samples
    [(_, drawn, [column])] = unpacked(replay.window(HEIGHT, 5.0, 6.0, 800))
    inside = (times >= 5.0 - 0.003) & (times <= 6.0 + 0.003)
    assert np.isin(times[(times >= 5.0) & (times <= 6.0)], drawn).all()
    assert np.isin(drawn, times[inside]).all()
    assert np.array_equal(column, heights[np.searchsorted(times, drawn)].astype(np.float32))


@pytest.mark.parametrize("points", [20, 150, 700])
def test_from_afar_a_window_holds_the_least_and_the_greatest(
    replay: Replay, samples: tuple[Any, Any], points: int
) -> None:
    times, heights = samples
    random = np.random.default_rng(points)
    for _ in range(20):
        start = random.uniform(0.0, 20.0)
        end = start + random.uniform(0.5, 24.0)
        [(_, drawn, [column])] = unpacked(replay.window(HEIGHT, start, end, points))
        real = ~np.isnan(column)
        inside = (times >= start) & (times <= end)
        assert np.count_nonzero(real) <= max(2 * points + 4, 2 * 3)
        assert np.nanmin(column) <= heights[inside].min().astype(np.float32)
        assert np.nanmax(column) >= heights[inside].max().astype(np.float32)
        assert (np.diff(drawn) >= 0.0).all()
        assert drawn[0] <= max(start, times[0]) + 1e-9
        assert drawn[-1] >= min(end, times[-1]) - 1e-9


@pytest.mark.parametrize(("start", "end", "points"), [(0.0, 24.0, 50), (10.9, 12.6, 2000)])
def test_silence_is_a_gap_at_every_resolution(
    replay: Replay, start: float, end: float, points: int
) -> None:
    [(_, times, [column])] = unpacked(replay.window(HEIGHT, start, end, points))
    [parted] = times[np.isnan(column)].tolist()
    assert 11.0 < parted < 12.5
    before, after = times[times < parted], times[times > parted]
    assert before.max() <= 11.0
    assert after.min() >= 12.5 - 1e-6


def test_an_expression_is_computed_from_every_sample_at_every_resolution(
    replay: Replay, samples: tuple[Any, Any]
) -> None:
    times, heights = samples
    [square] = replay.expressions(["square [m²] = state.position.z^2"])
    assert (square["unit"], square["topic"]) == ("m²", "state")
    for points in (20, 4000):
        [(_, _, [column])] = unpacked(replay.window([square["name"]], 0.0, 24.0, points))
        assert np.nanmax(column) == pytest.approx(np.max(heights**2), rel=1e-6)
        assert np.nanmin(column) == pytest.approx(np.min(heights**2), rel=1e-6)
    [value, _] = replay.at([square["name"]], 5.0)[square["name"]]
    assert value == pytest.approx(heights[times <= 5.0][-1] ** 2, rel=1e-6)
    spectrum = replay.spectra([square["name"]], 2.0, 9.0)["spectra"][0]
    assert spectrum["signal"] == square["name"]


def test_an_expression_of_two_topics_has_the_times_of_the_first(replay: Replay) -> None:
    [both] = replay.expressions(["= battery.voltage + 0*state.position.z"])
    [(_, times, [column])] = unpacked(replay.window([both["name"]], 0.0, 24.0, 4000))
    [(_, own, [voltage])] = unpacked(replay.window(["battery.voltage"], 0.0, 24.0, 4000))
    assert np.array_equal(times, own)
    inside = np.isfinite(column)
    assert inside.sum() > 0.8 * len(column)
    np.testing.assert_allclose(column[inside], voltage[inside])


def test_a_wrong_expression_is_a_problem_of_its_own(replay: Replay) -> None:
    good, bad = replay.expressions(["= -mass", "= mess"])
    assert "problem" not in good
    assert "did you mean mass" in bad["problem"]
    with pytest.raises(OutOfBoundsError, match="no signal mess"):
        replay.window(["= mess"], 0.0, 1.0, 100)


def test_statistics_are_of_every_sample_between_two_instants(
    replay: Replay, samples: tuple[Any, Any]
) -> None:
    times, heights = samples
    inside = heights[(times > 3.0) & (times <= 19.0)]
    found = replay.statistics(HEIGHT, 3.0, 19.0)["state.position.z"]
    assert found["count"] == len(inside)
    assert found["mean"] == pytest.approx(inside.mean())
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(inside**2)))
    assert (found["min"], found["max"]) == pytest.approx((inside.min(), inside.max()))
    assert replay.statistics(HEIGHT, 11.2, 12.2)["state.position.z"]["mean"] is None


def test_for_one_signal_over_another_values_of_an_instant_stay_together(replay: Replay) -> None:
    names = ["state.position.x", "= 2*state.position.x"]
    [(_, times, [single, double])] = unpacked(replay.window(names, 0.0, 24.0, 50, False))
    assert 25 < len(times) <= 52
    known = np.isfinite(single)
    np.testing.assert_allclose(double[known], 2 * single[known], rtol=1e-6)


def test_signals_of_the_same_ticks_share_their_times(replay: Replay) -> None:
    names = ["state.position.z", "reference.position.z", "thrust", "battery.voltage", "mass"]
    groups = unpacked(replay.window(names, 2.0, 4.0, 300))
    assert [signals for signals, *_ in groups] == [names[:3], ["battery.voltage"], ["mass"]]


def test_angles_are_shown_in_degrees_and_every_number_of_the_log_can_be(replay: Replay) -> None:
    found = replay.at(["state.yaw", "state/pose.pose.orientation.z"], 20.0)
    yaw, sine = found["state.yaw"][0], found["state/pose.pose.orientation.z"][0]
    assert yaw is not None
    assert yaw == pytest.approx(math.degrees(0.3 * math.sin(20.0 / 7.0)), abs=1e-3)
    assert sine == pytest.approx(math.sin(math.radians(yaw) / 2.0), abs=1e-6)


def test_an_instant_has_the_newest_values_and_their_ages(
    replay: Replay, samples: tuple[Any, Any]
) -> None:
    times, heights = samples
    for t in (0.0, 3.0001, 11.7, 23.0):
        k = int(np.searchsorted(times, t, side="right")) - 1
        value, age = replay.at(HEIGHT, t)["state.position.z"]
        assert value == heights[k]
        assert age == pytest.approx(t - times[k], abs=1e-4)
    assert replay.at(HEIGHT, -1.0) == {"state.position.z": [None, None]}


def test_a_number_that_never_changes_is_known_as_one(replay: Replay) -> None:
    row = next(row for row in replay.index["signals"] if row["name"] == "state/pose.covariance[7]")
    assert row["constant"] == 0.0
    [(_, _, [column])] = unpacked(replay.window([row["name"]], 5.0, 6.0, 100))
    assert (column == 0.0).all()


def test_an_unknown_signal_is_refused(replay: Replay) -> None:
    with pytest.raises(OutOfBoundsError, match="no signal 'nothing'"):
        replay.window(["nothing"], 0.0, 1.0, 100)


# ---------------------------------------------------------------------- what is derived
def test_tracking_error_is_state_less_reference(replay: Replay) -> None:
    t = 15.0
    names = ["error.position.x", "state.position.x", "reference.position.x"]
    error, state, reference = (replay.at([name], t)[name][0] for name in names)
    assert state is not None
    assert reference is not None
    assert error == pytest.approx(1e3 * (state - reference), abs=1e-3)  # mm
    assert reference == pytest.approx(position_at(RUN, t)[0], abs=1e-6)


def test_rotations_give_their_angles_and_world_velocities() -> None:
    random = np.random.default_rng(2)
    roll, pitch, yaw = random.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], (500, 3)).T
    half = [0.5 * a for a in (roll, pitch, yaw)]
    (cr, cp, cy), (sr, sp, sy) = ([f(h) for h in half] for f in (np.cos, np.sin))
    columns = {
        "pose.pose.orientation.w": cr * cp * cy + sr * sp * sy,
        "pose.pose.orientation.x": sr * cp * cy - cr * sp * sy,
        "pose.pose.orientation.y": cr * sp * cy + sr * cp * sy,
        "pose.pose.orientation.z": cr * cp * sy - sr * sp * cy,
        "twist.twist.linear.x": np.ones(500),
        "twist.twist.linear.y": np.zeros(500),
        "twist.twist.linear.z": np.zeros(500),
    }
    [source] = [one for one in NAMED_SOURCES if one.signals[0].name == "state.velocity.x"]
    assert source.function is not None
    values = source.function(*(columns[name] for name in source.columns))
    found = {signal.name: one for signal, one in zip(source.signals, values, strict=True)}
    for name, expected in (("roll", roll), ("pitch", pitch), ("yaw", yaw)):
        assert found[f"state.{name}"] == pytest.approx(np.degrees(expected), abs=1e-7)
    # The body's x axis in the world.
    assert found["state.velocity.x"] == pytest.approx(np.cos(yaw) * np.cos(pitch), abs=1e-9)
    assert found["state.velocity.z"] == pytest.approx(-np.sin(pitch), abs=1e-9)


def test_the_track_holds_the_path_and_its_silence(replay: Replay) -> None:
    rows = np.frombuffer(replay.track, np.float32).reshape(-1, WIDTH)
    rate = replay.index["track"]["rate"]
    assert rate == 50.0
    assert len(rows) == int(replay.index["duration"] * rate) + 1
    t = np.arange(len(rows)) / rate
    known = ~np.isnan(rows[:, 0])
    assert not known[(t > 11.5) & (t < 12.4)].any()
    assert known[t < 11.0].all()
    first = sum(len(PARTS[part]) for part in ("state",))
    heard = known & ((t < 11.0) | (t > 12.5))
    assert rows[heard, first : first + 3] == pytest.approx(position_at(RUN, t[heard]), abs=0.002)


# ---------------------------------------------------------------------- time line
def test_the_time_line_says_what_happened_and_when(replay: Replay) -> None:
    index = replay.described()
    assert [(one["text"], one["from"]) for one in index["spans"]["behavior"]] == [
        ("ground", 0.0),
        ("take_off", 3.0),
        ("follow_trajectory", 6.0),
        ("land", 21.0),
        ("ground", 23.1),
    ]
    assert index["marks"] == [
        {"t": 13.0, "text": "gust", "who": "anna"},
        {"t": 14.5, "text": "", "who": "anna"},
    ]
    assert index["changes"] == [
        {"t": 9.0, "name": "control.position.kp_xy", "who": "anna", "old": 4.0, "new": 5.5}
    ]
    assert index["events"] == [{"t": 3.0, "text": "take_off by anna", "warn": False}]
    assert index["parameters"]["control.position.kp_xy"] == 4.0
    assert "station.bearings.layout" in index["parameters"]
    assert index["beacons"][0]["beacons"][0] == [1, 1.0, 1.0, 0.1]
    assert index["volume"][2] == [0.2, 3.0]
    assert index["boxes"] == [[[1.0, 1.4], [-1.0, 1.0], [0.0, 2.0]]]
    moments = {one["label"]: one["t"] for one in index["moments"]}
    assert moments["start of recording"] == 0.0
    assert moments["arming"] == 1.0
    assert moments["take-off"] == 3.1
    assert moments["mark: gust"] == 13.0
    assert moments["follow trajectory"] == 6.0
    assert moments["ground 2"] == 23.1


def test_of_each_mark_the_newest_text_counts_at_the_marks_own_time(tmp_path: Path) -> None:
    """A later text has the stamp of its mark, and may be empty."""
    log = tmp_path / "a.mcap"
    told = [
        ("a", 2.0, 2.0, "gust"),
        ("b", 3.0, 3.0, "door"),
        ("c", 4.0, 4.0, ""),
        ("a", 2.0, 4.5, ""),
        ("b", 3.0, 5.0, "a door"),
        ("c", 4.0, 5.5, "wind"),
    ]
    with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
        for t in (0.0, 1.0):
            clock = new("std_msgs/String", data="x")
            writer.write("/quad1/note", "std_msgs/String", encode(clock), *(2 * [SECOND + _ns(t)]))
        for id, t, logged, text in told:
            stamp_ns = SECOND + _ns(t)
            mark = new(
                "quadlab_msgs/Mark", header=header(stamp_ns), id=id, text=text, requester="anna"
            )
            kind = "quadlab_msgs/Mark"
            writer.write("/quad1/marks", kind, encode(mark), SECOND + _ns(logged), stamp_ns)
    assert shown(log).described()["marks"] == [
        {"t": t, "text": text, "who": "anna"}
        for t, text in ((2.0, ""), (3.0, "a door"), (4.0, "wind"))
    ]


def test_events_that_are_left_out_of_the_time_line_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timeline, "MOST_LINES", 3)
    log = tmp_path / "a.mcap"
    with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
        for k in range(5):
            event = encode(new("rcl_interfaces/Log", stamp=time_message(SECOND + k), msg=f"{k}"))
            writer.write("/quad1/events", "rcl_interfaces/Log", event, SECOND + k, SECOND + k)
    index = shown(log).described()
    assert [one["text"] for one in index["events"]] == ["0", "1", "2"]
    assert index["problems"] == {"events": "only the first 3 of 5 messages are listed"}


def test_a_picture_is_the_newest_one_at_an_instant_to_the_byte(tmp_path: Path) -> None:
    log, jpeg = tmp_path / "a.mcap", b"\xff\xd8"
    taken = {2.0: jpeg + b"two" * 500, 3.0: jpeg + b"three", 2.5: jpeg, 5.0: b"GIF89a"}
    with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
        note = encode(new("std_msgs/String", data="x"))
        writer.write("/quad1/note", "std_msgs/String", note, *(2 * [SECOND]))
        for t, data in taken.items():  # one arrives late
            stamp_ns = SECOND + _ns(t)
            payload = encode_picture(stamp_ns, data, "quad1")
            writer.write("/quad1/tracker_picture", PICTURE, payload, SECOND + _ns(t), stamp_ns)
    replay = shown(log)
    assert replay.picture("tracker_picture", 1.9) is None
    for t, at in ((2.0, 2.0), (2.4, 2.0), (2.5, 2.5), (2.99, 2.5), (4.0, 3.0)):
        assert replay.picture("tracker_picture", t) == (at, taken[at])
    with pytest.raises(MeasurementError, match="not a JPEG"):
        replay.picture("tracker_picture", 6.0)
    told = "no pictures on camera_picture in this run; it has tracker_picture"
    with pytest.raises(OutOfBoundsError, match=told):
        replay.picture("camera_picture", 2.0)
    assert replay.described()["topics"]["tracker_picture"]["count"] == 4


def test_the_beacons_in_sight_are_those_of_the_newest_frame_until_it_is_old(tmp_path: Path) -> None:
    log = tmp_path / "a.mcap"
    frames = [(0.0, [4, -2]), (0.1, [4, -2]), (0.2, [4]), (0.3, [7, 8]), (2.0, [7, 8])]
    with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
        for t, ids in frames:
            stamp_ns = SECOND + _ns(t)
            payload = encode_bearings(stamp_ns, ids, np.eye(3)[: len(ids)], 0.02)
            kind = "quadlab_msgs/BearingArray"
            writer.write("/quad1/bearings", kind, payload, stamp_ns, stamp_ns)
    sights = shown(log).described()["sights"]
    assert [one["ids"] for one in sights] == [[4, -2], [4], [7, 8], [], [7, 8], []]
    expected = [0.0, 0.2, 0.3, 0.6, 2.0, 2.3]
    assert [one["t"] for one in sights] == pytest.approx(expected, abs=1e-6)
    assert sights[0]["sigma"] == pytest.approx(0.02)


def test_what_a_vehicle_sees_of_others_is_drawn_ten_times_a_second_and_at_the_end_of_each_spell(
    tmp_path: Path,
) -> None:
    log = tmp_path / "a.mcap"
    frames = [(0.01, [2, 3]), (0.04, [2]), (0.12, [3]), (0.5, [2, 3])]
    with LogWriter(log, {"vehicle": "quad1"}, {}) as writer:
        for t, ids in frames:
            stamp_ns = SECOND + _ns(t)
            payload = encode_bearings(stamp_ns, ids, np.eye(3)[: len(ids)], 0.02)
            kind = "quadlab_msgs/BearingArray"
            writer.write("/quad1/neighbour_bearings", kind, payload, stamp_ns, stamp_ns)
    seen = shown(log).described()["neighbours"]
    first = [[2, 1.0, 0.0, 0.0], [3, 0.0, 1.0, 0.0]]
    assert [one["seen"] for one in seen] == [first, [[3, 1.0, 0.0, 0.0]], first]
    assert [one["t"] for one in seen] == pytest.approx([0.0, 0.11, 0.49], abs=1e-6)
    assert seen[0]["sigma"] == pytest.approx(0.02)
    assert shown(log).described()["sights"] == []


def _ns(seconds: float) -> int:
    return round(1e9 * seconds)


# ---------------------------------------------------------------------- clocks
@pytest.mark.parametrize("clock", [0, -3_600 * 10**9, 45 * 10**9])
def test_a_vehicle_with_a_clock_of_its_own_lies_on_the_stations(tmp_path: Path, clock: int) -> None:
    made = MadeRun(8.0, marks=[(5.0, "here")], clock_ns=clock)
    index = shown(write_run(tmp_path / "a.mcap", made)).described()
    # The shortest delay seen remains unknown.
    assert index["marks"][0]["t"] == pytest.approx(5.0, abs=0.011)
    assert index["duration"] == pytest.approx(8.0, abs=0.03)


def test_a_clock_that_was_set_in_between_is_not_believed() -> None:
    log_ns = np.arange(100, dtype=np.int64) * STEP_NS
    publish_ns = log_ns - 1000
    publish_ns[60:] += 20 * 10**9
    assert common_stamps(log_ns, publish_ns) is log_ns
    assert common_stamps(log_ns, log_ns - 1000).tolist() == (log_ns - 1000).tolist()


def test_gaps_are_longer_than_what_is_usual_of_the_topic() -> None:
    times = np.concatenate([np.arange(100) * 0.002, 0.4 + np.arange(100) * 0.002])
    assert gaps(times).tolist() == [99]
    assert gaps(np.arange(50.0) * 0.5).tolist() == []


# ---------------------------------------------------------------------- least and greatest
@pytest.mark.parametrize("name", ["state.position.z", "state.yaw", "error.distance"])
def test_a_whole_flight_is_drawn_from_the_least_and_greatest_of_its_samples(
    replay: Replay, name: str
) -> None:
    """The signals are a column, one made of columns, and one made of other signals."""
    [(_, _, [every])] = unpacked(replay.window([name], 0.0, 30.0, 12_000))
    [(_, _, [few])] = unpacked(replay.window([name], 0.0, 30.0, 200))
    assert np.count_nonzero(~np.isnan(every)) > BIN * 200
    every, few = (one[~np.isnan(one)] for one in (every, few))
    size = BIN * math.ceil(math.ceil(len(every) / BIN) / 200)
    begins = np.arange(0, len(every), size)
    assert few[0::2].tolist() == np.minimum.reduceat(every, begins).tolist()
    assert few[1::2].tolist() == np.maximum.reduceat(every, begins).tolist()


def test_a_bin_is_nan_only_where_all_of_it_is() -> None:
    values = np.array([np.nan, 1.0, np.nan, np.nan, 3.0])
    low, high = coarser(values, values, 2)
    assert np.array_equal(low, [1.0, np.nan, 3.0], equal_nan=True)
    assert np.array_equal(high, low, equal_nan=True)


# ---------------------------------------------------------------------- what cannot be shown
@pytest.mark.parametrize(
    ("content", "why"),
    [(b"", "is empty"), (b"PK\x03\x04 zip", "not an MCAP log"), (None, "to show")],
)
def test_a_log_without_messages_is_refused(tmp_path: Path, content: bytes | None, why: str) -> None:
    log = tmp_path / "a.mcap"
    if content is None:
        write_run(log, MadeRun(0.0))
    else:
        log.write_bytes(content)
    with pytest.raises(LogFormatError, match=why) as caught:
        build_replay(log, lambda _: None)
    assert "\n" not in str(caught.value)


def test_a_torn_log_is_shown_up_to_its_tear(tmp_path: Path) -> None:
    log = write_run(tmp_path / "a.mcap", MadeRun(10.0))
    data = log.read_bytes()
    log.write_bytes(data[: len(data) // 2])
    index = shown(log).described()
    assert 4.0 < index["duration"] < 7.0
    assert index["tear"].startswith("ends within a record")
