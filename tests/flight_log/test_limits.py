"""No reader uses more than 500 MB, whatever a log claims or has."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from flight_log import read_attachments, read_log, summarize
from flight_log.blocks import BLOCK_BYTES, BlockReader
from flight_log.check import check_log
from flight_log.limits import MAX_BYTES
from flight_log.reader import read_topic
from flight_log.run import read_run
from quadrotor.errors import LogFormatError
from tests.crafted_logs import (
    CRAFTED,
    TINY,
    at_the_limit,
    chunk,
    many_loose,
    many_tiny,
    message,
    packed,
    write,
)

MOST = 500_000_000
READERS = """
import sys
from pathlib import Path
from quadrotor.errors import QuadlabError
from flight_log import read_attachments, read_log, summarize
from flight_log.check import check_log
from flight_log.check import damage
from flight_log.reader import read_topic
from flight_log.run import read_run
for log in map(Path, sys.argv[1:]):
    Path("/proc/self/clear_refs").write_text("5")  # the peak counts anew
    for read in (summarize, lambda p: sum(1 for _ in read_log(p)), check_log, read_attachments,
                 lambda p: sum(1 for _ in read_topic(p, "tiny")), damage):
        try:
            read(log)
        except QuadlabError:
            pass
        except MemoryError:
            sys.exit(f"{log.name}: out of memory")
    # Not ru_maxrss, which begins with that of the process that started this one.
    print(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1])
"""


def limited() -> None:
    """Limit the address space, above what Python, numpy and lz4 map without using it."""
    resource.setrlimit(resource.RLIMIT_AS, (3 * MOST, 3 * MOST))


def peaks(*logs: Path) -> list[int]:
    """Return the peak memory, in bytes, of a process that used each reader on each log."""
    run = [sys.executable, "-c", READERS, *map(str, logs)]
    done = subprocess.run(
        run, preexec_fn=limited, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return [int(line) * 1024 for line in done.stdout.split()]


def test_what_claims_or_holds_too_much_is_read_within_bounds(tmp_path: Path) -> None:
    kinds = sorted(CRAFTED.keys() - {"many_tiny", "many_loose", "at_the_limit"})
    found = peaks(*(CRAFTED[kind](tmp_path / f"{kind}.mcap") for kind in kinds))
    assert len(found) == len(kinds)
    assert {k: peak for k, peak in zip(kinds, found, strict=True) if peak > MOST} == {}


def test_messages_outside_of_chunks_are_not_held(tmp_path: Path) -> None:
    few, many = peaks(*(many_loose(tmp_path / f"{n}.mcap", n) for n in (1000, 200_000)))
    assert many - few < 50_000_000  # a message takes more than 250 bytes as objects


def test_a_chunk_larger_than_is_read_is_refused_in_one_line(tmp_path: Path) -> None:
    size = MAX_BYTES + 1_000_000
    log = write(tmp_path / "a.mcap", chunk(packed([bytes(1_000_000)] * (size // 10**6)), size))
    for read in (check_log, read_attachments, lambda path: list(read_log(path))):
        with pytest.raises(LogFormatError) as refusal:
            read(log)
        told = str(refusal.value)
        assert f"opens to {size // 10**6} MB" in told
        assert f"at most {MAX_BYTES // 10**6} MB" in told
        assert "\n" not in told
    assert summarize(log).message_count == 1  # as in its index


@pytest.mark.parametrize("size", [1_000_000, 4_000_000, 64 * 2**20])
def test_large_chunks_of_other_writers_are_read_in_several_blocks(
    tmp_path: Path, size: int
) -> None:
    body = b"\0\1\0\0" + bytes(10_000)
    one = message(1, body)
    count = size // len(one)
    log = write(tmp_path / "a.mcap", chunk(packed([one] * count), count * len(one)), count=count)
    blocks = list(BlockReader(log))
    assert sum(len(block.places[1]) for block in blocks) == count
    for block in blocks:
        assert len(block.places[1]) * len(one) <= 2 * BLOCK_BYTES + len(one)
    assert sum(len(found.payload) == len(body) for found in read_log(log)) == count
    assert sum(1 for _ in read_topic(log, "tiny")) == count


def test_an_index_that_names_a_message_twice_is_not_believed(tmp_path: Path) -> None:
    log = CRAFTED["repeated_places"](tmp_path / "a.mcap")
    assert check_log(log).count == 1


def test_what_is_in_a_log_is_told_by_its_index_alone(tmp_path: Path) -> None:
    log = many_tiny(tmp_path / "a.mcap", 100_000)
    data = bytearray(log.read_bytes())
    data[200:4000] = bytes(3800)  # its messages
    log.write_bytes(data)
    assert summarize(log).message_count == 100_000


def test_a_log_without_an_index_is_counted_block_by_block(tmp_path: Path) -> None:
    log = many_loose(tmp_path / "a.mcap", 400_000)
    shares: list[float] = []
    found = summarize(log, shares.append)
    assert (found.message_count, found.closed) == (400_000, False)
    assert len(shares) > 3
    assert shares == sorted(shares)


def test_a_run_of_more_messages_than_are_held_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = many_tiny(tmp_path / "a.mcap", 50_000)
    assert [len(one) for one in read_run(log).topics.values()] == [50_000]
    monkeypatch.setattr("flight_log.run.MAX_MESSAGES", 49_999)
    with pytest.raises(LogFormatError, match="50000 messages; at most 49999"):
        read_run(log)


def test_a_block_of_the_smallest_messages_is_given_in_pieces(tmp_path: Path) -> None:
    log = at_the_limit(tmp_path / "a.mcap", 9_000_000)
    found = check_log(log)
    assert found.count == 9_000_000 // len(message(1, TINY)) // 1000 * 1000
