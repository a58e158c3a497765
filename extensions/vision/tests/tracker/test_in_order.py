"""Items of several sources come out in the order of their time, and wait no longer than needed."""

from __future__ import annotations

from extensions.vision.tracker.in_order import LONGEST_NS, SILENT_NS, InOrder

MS = 1_000_000


def taken(order: InOrder[str], now: int) -> list[str]:
    return order.due(now * MS)


def test_an_item_waits_for_an_older_one_of_a_slower_source() -> None:
    order: InOrder[str] = InOrder(2)
    order.put(0, 0, "a0", 2 * MS)
    order.put(1, 1 * MS, "b1", 13 * MS)  # 12 ms late
    assert taken(order, 13) == ["a0", "b1"]
    order.put(0, 33 * MS, "a33", 35 * MS)
    assert taken(order, 35) == []
    order.put(1, 30 * MS, "b30", 42 * MS)
    assert taken(order, 42) == ["b30"]
    assert order.due_ns(42 * MS) == 45 * MS
    assert taken(order, 45) == ["a33"]


def test_nothing_waits_for_a_source_that_is_silent_and_only_shortly_for_a_slow_one() -> None:
    order: InOrder[str] = InOrder(2)
    order.put(1, 0, "b0", 900 * MS)
    order.put(0, 890 * MS, "a", 900 * MS)
    assert taken(order, 900) == ["b0"]
    assert taken(order, 890 + LONGEST_NS // MS) == ["a"]
    later = 900 + SILENT_NS // MS
    order.put(0, later * MS, "c", later * MS)
    assert taken(order, later) == ["c"]


def test_an_item_that_comes_too_late_is_dropped() -> None:
    order: InOrder[str] = InOrder(2)
    order.put(0, 50 * MS, "a", 50 * MS)
    assert taken(order, 50) == ["a"]
    order.put(1, 40 * MS, "b", 60 * MS)
    assert taken(order, 1000) == []
