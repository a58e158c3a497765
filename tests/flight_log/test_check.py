"""`check_log` finds what is wrong with a log, and nothing in a sound one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, Writer

from flight_log import LogWriter
from flight_log.check import check_log
from quadrotor.errors import LogFormatError
from vehicle_link.messages import encode, header, new

START = 1_769_851_842_000_000_000
PERIOD = 2_000_000


def write(path: Path, stamps: list[int], topic: str = "state", received: Any = None) -> Path:
    """Write odometry with these stamps (ns since START), received at once by default."""
    with LogWriter(path, {"vehicle": "q"}, {}) as log:
        for stamp, came in zip(stamps, received or stamps, strict=True):
            message = new("nav_msgs/Odometry", header=header(START + stamp))
            log.write(
                f"/q/{topic}", "nav_msgs/Odometry", encode(message), START + came, START + stamp
            )
    return path


def regular(count: int) -> list[int]:
    return [k * PERIOD for k in range(count)]


def test_a_sound_log_has_no_problem_and_its_rate_is_told(tmp_path: Path) -> None:
    found = check_log(write(tmp_path / "a.mcap", regular(1000)))
    state = found.topics["/q/state"]
    assert (found.problems, found.notes, found.count) == ([], [], 1000)
    assert (state.rate, state.duration) == pytest.approx((500.0, 1.998))


def test_a_gap_is_noted_with_its_place_and_length(tmp_path: Path) -> None:
    stamps = [*regular(400), *(800_000_000 + 500_000_000 + s for s in regular(100))]
    found = check_log(write(tmp_path / "a.mcap", stamps))
    assert found.problems == []
    assert found.notes == ["/q/state: 1 gaps, 0.50 s in all, the longest 0.50 s at 0.80 s"]


def test_what_mostly_comes_more_seldom_than_usual_has_no_gaps_for_that(tmp_path: Path) -> None:
    stamps = [200_000_000 * k for k in range(100)]  # 5 Hz; 50 is usual
    assert check_log(write(tmp_path / "a.mcap", stamps, "estimator")).notes == []
    stamps[60:] = [stamp + 3_000_000_000 for stamp in stamps[60:]]
    found = check_log(write(tmp_path / "b.mcap", stamps, "estimator"))
    assert found.notes == ["/q/estimator: 1 gaps, 3.20 s in all, the longest 3.20 s at 11.80 s"]


def test_a_status_sent_seldom_while_nothing_happens_has_no_gaps_for_that(tmp_path: Path) -> None:
    """The stamps are a second apart, a little more or less; the usual rate is five a second."""
    stamps = [1_000_000_000 * k + (-1) ** k * 400_000 for k in range(20)]
    assert check_log(write(tmp_path / "a.mcap", stamps, "experiment_status")).notes == []


def test_a_stamp_that_goes_back_is_a_problem(tmp_path: Path) -> None:
    stamps = regular(100)
    stamps[50], stamps[51] = stamps[51], stamps[50]
    problems = check_log(write(tmp_path / "a.mcap", stamps)).problems
    assert problems == ["/q/state: 1 stamps go back", "/q/state: 1 receptions go back"]


OVERTOOK = "datagrams overtook one another"
REASONS = {
    "tracker_pose": OVERTOOK,
    "bearings": OVERTOOK,
    "joy": OVERTOOK,
    "bearing_pose": OVERTOOK,
    "estimator": OVERTOOK,
    "state": "",
    "imu": "",
    "truth": "",
    "station_status": "",
    "events": "vehicle and station each stamp their own",
}


@pytest.mark.parametrize(("topic", "reason"), REASONS.items())
def test_stamps_that_may_go_back_are_noted_and_no_problem(
    tmp_path: Path, topic: str, reason: str
) -> None:
    stamps = regular(100)
    stamps[50], stamps[51] = stamps[51], stamps[50]
    found = check_log(write(tmp_path / "a.mcap", stamps, topic, regular(100)))
    line = f"/q/{topic}: 1 stamps go back"
    told = ([], [f"{line}: {reason}"]) if reason else ([line], [])
    assert (found.problems, found.notes) == told
    backwards = check_log(write(tmp_path / "b.mcap", regular(100), topic, stamps))
    assert backwards.problems == [f"/q/{topic}: 1 receptions go back"]


def test_a_torn_log_says_how_to_mend_it(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", regular(3000))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    [problem] = check_log(path).problems
    assert problem.startswith("it is torn: it ends within a record after byte")
    assert problem.endswith(f"repair it: quadlab log recover {path}")


def test_a_flipped_byte_is_a_damaged_chunk_and_fewer_messages(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", regular(3000))
    data = bytearray(path.read_bytes())
    data[5000] ^= 0xFF
    path.write_bytes(data)
    found = check_log(path)
    assert found.problems == ["1 damaged chunks, whose messages are lost"]
    assert 0 < found.count < 3000


def test_messages_that_are_not_of_their_type_are_a_problem(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with LogWriter(path, {}, {}) as log:
        log.write("/q/state", "nav_msgs/Odometry", b"\0\1\0\0" + bytes(20), START, START)
    assert check_log(path).problems == [
        "/q/state: 24 bytes are not a geometry_msgs/msg/Point: too few"
    ]


def test_another_version_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start("ros2", "other")
        schema = writer.register_schema("quadlab_msgs/msg/Mark", "ros2msg", b"float64 when\n")
        channel = writer.register_channel("/q/marks", "cdr", schema)
        writer.add_message(channel, START, b"\0\1\0\0" + bytes(8), START)
        writer.finish()
    found = check_log(path)
    assert found.problems == []
    [note] = found.notes
    assert note.startswith("quadlab_msgs/msg/Mark has other fields here than in this version")


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"PK\3\4" + bytes(100))
    with pytest.raises(LogFormatError, match="not an MCAP"):
        check_log(path)
