"""Trails: bounded, gaps drawn as gaps, little sent again."""

from __future__ import annotations

import numpy as np
import pytest

from web.view.trails import CHUNK, CHUNKS, DURATION, HEAD, TrailRing

RATE = 30.0


def drawn(ring: TrailRing) -> np.ndarray:
    """Return all segments that are shown, shape (N, 2, 3)."""
    pieces = [*ring.chunks, ring.head]
    return np.concatenate([p.segments[: p.count] for p in pieces])


def line(ring: TrailRing, samples: int, start: float = 0.0, step: float = 0.01) -> list[set[int]]:
    return [
        ring.add((start + step * k, 0.0, 1.0), (start / step + k) / RATE) for k in range(samples)
    ]


def test_segments_join_the_points() -> None:
    ring = TrailRing()
    line(ring, 200)
    segments = drawn(ring)
    assert len(segments) == 199
    ordered = segments[np.argsort(segments[:, 0, 0])]
    np.testing.assert_allclose(ordered[1:, 0], ordered[:-1, 1])


def test_a_trail_is_never_longer_than_its_duration() -> None:
    ring = TrailRing()
    line(ring, int(3 * DURATION * RATE))
    assert len(drawn(ring)) <= DURATION * RATE + 1
    assert len(drawn(ring)) >= (DURATION - 2 * CHUNK / RATE) * RATE


def test_standing_still_adds_nothing_and_old_pieces_go() -> None:
    ring = TrailRing()
    line(ring, 200)
    count = len(drawn(ring))
    last = (1.99, 0.0, 1.0)
    assert ring.add(last, 200 / RATE) == set()
    assert len(drawn(ring)) == count
    for k in range(int(30 * RATE)):
        ring.add(last, 200 / RATE + k / RATE)
    assert len(drawn(ring)) <= HEAD


@pytest.mark.parametrize(("point", "pause"), [((5.0, 0.0, 1.0), 1 / RATE), ((1.0, 0.0, 1.0), 3.0)])
def test_a_jump_and_a_silence_are_gaps(point: tuple[float, float, float], pause: float) -> None:
    ring = TrailRing()
    line(ring, 10)
    ring.add(point, 9 / RATE + pause)
    start, end = drawn(ring)[-1]
    np.testing.assert_allclose(start, point)
    np.testing.assert_allclose(end, point)


def test_only_the_head_changes_but_twice_a_second() -> None:
    ring = TrailRing()
    changes = line(ring, 1 + 10 * HEAD)[1:]
    assert all(-1 in change for change in changes)
    assert sum(len(change) > 1 for change in changes) == 9


def test_padding_repeats_the_last_point() -> None:
    ring = TrailRing()
    line(ring, 4)
    assert (ring.head.segments[3:] == np.array([0.03, 0.0, 1.0], np.float32)).all()


def test_clearing_forgets_everything() -> None:
    ring = TrailRing()
    line(ring, 300)
    changed = ring.clear()
    assert -1 in changed
    assert len(changed) >= 2
    assert len(drawn(ring)) == 0
    assert ring.add((9.0, 9.0, 9.0), 100.0) == set()


def test_the_ring_has_room_for_its_duration() -> None:
    assert CHUNKS * CHUNK / RATE >= DURATION
