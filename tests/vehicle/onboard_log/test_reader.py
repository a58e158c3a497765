"""Queries of the onboard log: every tick of a span, in bounded answers, while it grows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from quadrotor.records import Record
from tests.support.ticks import START_NS, STEP_NS, level_ticks
from vehicle.onboard_log import reader as onboard_reader
from vehicle.onboard_log.file import Batch
from vehicle.onboard_log.onboard_log import OnboardLog
from vehicle.onboard_log.parameters import OnboardLogParameters
from vehicle.onboard_log.reader import VALUES_MAX, OnboardReader
from vehicle_link.messages import decode, encode, new
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.idempotent import answering

TYPE = SERVICES["onboard_log"]
HEIGHT, YAW, SCALING = "state.pose.pose.position.2", "reference.yaw", "actuators.scaling"


def ticks(first: int, count: int, *, armed: bool = True) -> Record:
    """Return ticks whose numbers count up in each column."""
    made, numbers = level_ticks(first, count, armed=armed), np.arange(first, first + count)
    made["state"]["position_w"][:, 2] = numbers
    made["reference"]["yaw"] = -numbers
    made["actuators"]["scaling"] = 0.5
    return made


class Vehicle:
    """Log that is written at once and not by its thread, and its reader, in the wire format."""

    def __init__(self, folder: Path) -> None:
        self.free = 2 * OnboardLogParameters().stop_bytes
        self.log = OnboardLog(folder, "quad1", {}, lambda *_: None, free=lambda _: self.free)
        self.waited = 0.0
        self.while_waiting: list[Record] = []
        self.reader = OnboardReader(self.log, "quad1", self._wait)

    def _wait(self, seconds: float) -> None:
        self.waited += seconds
        if self.while_waiting:
            self.feed(self.while_waiting.pop(0))

    def feed(self, batch: Record) -> None:
        parts = [batch[start : start + 5] for start in range(0, len(batch), 5)]
        batches = [Batch(part, int(part["imu"]["stamp_ns"][-1]) + 1_000_000) for part in parts]
        for first in range(0, len(batches), 3):  # as many as arrive until the next check
            self.log._store(batches[first : first + 3])

    def ask(self, first: int, last: int, *columns: str, rows: int = 0) -> Any:
        request = new(
            f"{TYPE}_Request",
            columns=columns or (HEIGHT,),
            rows=rows,
            start_ns=START_NS + STEP_NS * first,
            end_ns=START_NS + STEP_NS * last,
        )
        answer = answering(TYPE, self.reader.answer)(decode(encode(request), f"{TYPE}_Request"))
        return decode(encode(answer), f"{TYPE}_Response")

    def numbers(self, answer: Any) -> list[int]:
        assert answer.accepted, answer.reason
        return list(((answer.stamps_ns - START_NS) // STEP_NS).tolist())


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Vehicle]:
    made = Vehicle(tmp_path)
    yield made
    made.log.close()


def test_a_stretch_of_a_closed_log_is_there_tick_by_tick(vehicle: Vehicle) -> None:
    vehicle.feed(ticks(0, 5000))
    vehicle.log.close()
    answer = vehicle.ask(1234, 2233, HEIGHT, YAW, SCALING)
    assert vehicle.numbers(answer) == list(range(1234, 2234))
    assert answer.complete
    assert answer.damaged == 0
    values = answer.values.reshape(-1, 3)
    np.testing.assert_array_equal(values[:, 0], np.arange(1234, 2234))
    np.testing.assert_array_equal(values[:, 1], -np.arange(1234, 2234))
    np.testing.assert_array_equal(values[:, 2], 0.5)


def test_answers_are_bounded_and_follow_one_another_without_a_seam(vehicle: Vehicle) -> None:
    vehicle.feed(ticks(0, 3000))
    vehicle.log.close()
    columns = [f"state.pose.pose.position.{i % 3}" for i in range(40)]
    numbers: list[int] = []
    while True:
        answer = vehicle.ask(numbers[-1] + 1 if numbers else 100, 2600, *columns)
        assert len(answer.values) <= VALUES_MAX
        numbers += vehicle.numbers(answer)
        if answer.complete:
            break
    assert numbers == list(range(100, 2601))
    assert vehicle.numbers(vehicle.ask(0, 2000, rows=7)) == list(range(7))


def test_a_log_that_is_being_written_is_waited_for_and_no_longer_than_allowed(
    vehicle: Vehicle,
) -> None:
    vehicle.feed(ticks(0, 100))
    vehicle.while_waiting = [ticks(100 + 50 * k, 50) for k in range(30)]
    answer = vehicle.ask(40, 199)
    assert answer.complete
    assert vehicle.numbers(answer) == list(range(40, 200))
    vehicle.while_waiting, before = [], vehicle.waited
    beyond = vehicle.ask(150, 10_000)
    assert not beyond.complete, "more may still be flown"
    assert vehicle.numbers(beyond) == list(range(150, 150 + len(beyond.stamps_ns)))
    assert vehicle.waited - before == pytest.approx(onboard_reader.PATIENCE_S, abs=0.03)


def test_lost_ticks_are_a_gap_and_not_made_up(vehicle: Vehicle) -> None:
    vehicle.feed(ticks(0, 500))
    vehicle.feed(ticks(700, 500))
    vehicle.log.close()
    answer = vehicle.ask(400, 799)
    assert vehicle.numbers(answer) == [*range(400, 500), *range(700, 800)]
    assert answer.complete


def test_a_damaged_chunk_is_said_and_the_rest_read(vehicle: Vehicle) -> None:
    vehicle.feed(ticks(0, 3000))
    vehicle.log.close()
    [written] = vehicle.log.files()
    content = bytearray(written.path.read_bytes())
    with written.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunks = summary.chunk_indexes
    middle = chunks[len(chunks) // 2].chunk_start_offset + 100
    content[middle : middle + 200] = bytes(200)
    written.path.write_bytes(content)
    answer = vehicle.ask(0, 2999)
    assert answer.damaged == 1
    assert 0 < 3000 - len(answer.stamps_ns) < 300


def test_reading_begins_near_the_stretch_not_at_the_start_of_the_file(vehicle: Vehicle) -> None:
    vehicle.feed(ticks(0, 6000))
    vehicle.log.close()
    [written] = vehicle.log.files()
    size = written.path.stat().st_size
    place = written.place_before(START_NS + STEP_NS * 5500)
    assert 0.7 * size < place < size
    assert vehicle.numbers(vehicle.ask(5500, 5999)) == list(range(5500, 6000))


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        (("truth.pose",), "a topic of state, reference, imu, actuators comes first"),
        (("state.pose.pose.position.3",), "no column 'state.pose.pose.position.3'"),
        (("state.pose.pose.position",), "no column"),
        (("state.header.frame_id",), "no column"),
        ((HEIGHT,) * 49, "49 columns; allowed are 1 to 48"),
    ],
)
def test_a_wrong_question_is_answered_with_what_is_allowed(
    vehicle: Vehicle, columns: tuple[str, ...], reason: str
) -> None:
    vehicle.feed(ticks(0, 100))
    vehicle.log.close()
    answer = vehicle.ask(0, 10, *columns)
    assert not answer.accepted
    assert reason in answer.reason


def test_without_a_log_it_says_why(vehicle: Vehicle) -> None:
    assert "written while the vehicle is armed" in vehicle.ask(0, 10).reason
    vehicle.free = 0
    vehicle.feed(ticks(0, 10))
    vehicle.log.close()
    assert "delete old runs" in vehicle.ask(0, 10).reason
    assert "allowed are up to 120 s" in vehicle.ask(0, 70_000).reason
    assert "not a part" in vehicle.ask(10, 0).reason
