"""A torn log is read up to the tear and becomes a closed one."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from flight_log import LogWriter, is_closed, read_log, read_metadata, recover, summarize
from flight_log.records import ReadState
from quadrotor.errors import LogFormatError, StorageError

STRING = "std_msgs/String"


@pytest.fixture(scope="module")
def whole_bytes(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return a closed log of 300 messages in several chunks."""
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    seeded = random.Random(7)
    with LogWriter(path, {"run_id": "whole"}, {"parameters.json": b"[1]" * 50}) as log:
        for i in range(300):
            log.write(f"/t{i % 3}", STRING, seeded.randbytes(150), i * 2_000_000, i)
    return path.read_bytes()


def payloads(path: Path) -> list[bytes]:
    return [m.payload for m in read_log(path)]


def test_a_cut_anywhere_leaves_a_prefix_and_recovers_to_the_same(
    tmp_path: Path, whole_bytes: bytes
) -> None:
    whole = tmp_path / "whole.mcap"
    whole.write_bytes(whole_bytes)
    expected = payloads(whole)
    seed = 11
    seeded = random.Random(seed)
    cuts = [9, 40, 300, len(whole_bytes) - 1, len(whole_bytes) - 8] + [
        seeded.randrange(300, len(whole_bytes)) for _ in range(40)
    ]
    torn = tmp_path / "torn.mcap"
    for cut in cuts:
        torn.write_bytes(whole_bytes[:cut])
        if cut < 40:
            with pytest.raises(LogFormatError):
                payloads(torn)
            continue
        before = payloads(torn)
        assert before == expected[: len(before)], f"cut at {cut}, seed {seed}"
        recovery = recover(torn)
        assert recovery.torn
        assert recovery.messages == len(before)
        assert payloads(torn) == before
        assert is_closed(torn)
    assert not list(tmp_path.glob("*.recovering"))


def test_a_file_cut_in_its_index_loses_no_message(tmp_path: Path, whole_bytes: bytes) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole_bytes[:-20])
    assert recover(torn).messages == 300


def test_a_recovered_file_says_so_and_opens_with_a_seeking_reader(
    tmp_path: Path, whole_bytes: bytes
) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole_bytes[: len(whole_bytes) // 2])
    recovery = recover(torn)
    metadata = read_metadata(torn)
    assert metadata["quadlab.run"] == {"run_id": "whole"}
    assert metadata["quadlab.recovered"]["messages"] == str(recovery.messages)
    assert "within a record" in metadata["quadlab.recovered"]["reason"]
    summary = summarize(torn)
    assert summary.closed
    assert summary.recovered
    assert summary.attachments == {"parameters.json": 150}
    with torn.open("rb") as stream:
        assert len(list(make_reader(stream).iter_messages())) == recovery.messages > 0


def test_a_closed_file_is_left_alone(tmp_path: Path, whole_bytes: bytes) -> None:
    whole = tmp_path / "whole.mcap"
    whole.write_bytes(whole_bytes)
    assert not recover(whole).torn
    assert whole.read_bytes() == whole_bytes


def test_a_damaged_chunk_costs_only_itself(tmp_path: Path, whole_bytes: bytes) -> None:
    path = tmp_path / "damaged.mcap"
    damaged = bytearray(whole_bytes)
    middle = len(damaged) // 3
    damaged[middle : middle + 64] = bytes(64)
    path.write_bytes(damaged)
    state = ReadState()
    kept = [m.payload for m in read_log(path, state=state)]
    assert state.damaged_chunks == 1
    assert 200 < len(kept) < 300
    assert state.closed


def test_garbage_behind_the_tear_is_not_read_as_messages(
    tmp_path: Path, whole_bytes: bytes
) -> None:
    seed = 3
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole_bytes[: len(whole_bytes) // 2] + random.Random(seed).randbytes(5000))
    whole = tmp_path / "whole.mcap"
    whole.write_bytes(whole_bytes)
    kept = payloads(torn)
    assert kept == payloads(whole)[: len(kept)], f"seed {seed}"
    recover(torn)
    assert payloads(torn) == kept


def test_zeros_behind_the_tear_are_not_read_as_messages(tmp_path: Path, whole_bytes: bytes) -> None:
    """Some file systems leave these zeros after a power cut."""
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole_bytes[: len(whole_bytes) // 2])
    kept = payloads(torn)
    torn.write_bytes(torn.read_bytes() + bytes(4096))
    assert payloads(torn)[: len(kept)] == kept
    assert recover(torn).messages == len(kept)


@pytest.mark.parametrize("content", [b"", b"hello, world, I am no log", bytes(100)])
def test_what_is_no_log_is_refused_and_kept(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "foreign.mcap"
    path.write_bytes(content)
    with pytest.raises(LogFormatError, match=r"foreign\.mcap"):
        recover(path)
    assert path.read_bytes() == content


def test_a_log_that_is_being_written_is_not_touched(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    log = LogWriter(path, {}, {})
    log.write("/a", STRING, b"\0\1\0\0", 0, 0)
    with pytest.raises(StorageError, match="being written"):
        recover(path)
    log.write("/a", STRING, b"\0\1\0\0", 1, 0)
    log.close()
    assert len(payloads(path)) == 2


def test_the_summary_of_a_torn_file_tells_where_it_ends(tmp_path: Path, whole_bytes: bytes) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole_bytes[: len(whole_bytes) // 2])
    summary = summarize(torn)
    assert not summary.closed
    assert "within a record" in summary.tear
    assert summary.message_count == len(payloads(torn))
    assert set(summary.topics) == {"/t0", "/t1", "/t2"}


def test_a_missing_file_is_one_clear_line(tmp_path: Path) -> None:
    for act in (recover, summarize, payloads):
        with pytest.raises(StorageError, match="cannot read"):
            act(tmp_path / "absent.mcap")
