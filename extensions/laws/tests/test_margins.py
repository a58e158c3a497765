"""Laws at equal delay margin: what is scaled, and that the margin is then that of the first law."""

from __future__ import annotations

from pathlib import Path

import pytest

from extensions.laws.arena.cells import Entry, entries
from extensions.laws.arena.margins import at_equal_margin, at_margin, delay_margin, scaled
from extensions.laws.arena.own_laws import OwnLaw
from quadrotor.errors import UsageError


def test_gains_are_scaled_by_their_units_within_their_bounds() -> None:
    plain = scaled(entries()["geometric"], 1.5).settings
    assert plain["position.kp_xy"] == pytest.approx(4.0 * 1.5**2)
    assert plain["attitude.kw_xy"] == pytest.approx(12.0 * 1.5)
    assert plain["position.ki_xy"] == pytest.approx(1.0 * 1.5**3)
    assert scaled(entries()["geometric"], 2.0).settings["position.ki_xy"] == 5.0  # 8 is too much
    assert not any(name.startswith(("limits", "plugin", "indi")) for name in plain)
    observer = scaled(entries()["observer"], 1.2).settings
    assert observer["disturbance.force"] is True
    cascade = scaled(entries()["pid_cascade"], 1.2).settings
    assert {name.partition(".")[0] for name in cascade} == {"pid_cascade"}
    assert scaled(entries()["nmpc"], 2.0).settings["nmpc.thrust"] == pytest.approx(20.0 / 2**4)


def test_other_laws_get_the_delay_margin_of_the_first() -> None:
    """The adaptive law tolerates less than the plain one, so it has to become slower."""
    plain, l1 = entries()["geometric"], entries()["geometric_l1"]
    margin = delay_margin(plain)
    assert delay_margin(l1) < margin - 0.01
    (first, slower), told = at_equal_margin([plain, l1])
    assert first is plain
    assert delay_margin(slower) == margin
    assert float(slower.settings["position.kp_xy"]) < 0.75 * 4.0
    assert f"at the delay margin of geometric, {1e3 * margin:.0f} ms, with bandwidths geo" in told


def test_a_law_without_known_gains_or_enough_margin_is_refused() -> None:
    own = Entry("mine", "mine", own=OwnLaw([str(Path("mine.py"))]))
    with pytest.raises(UsageError, match="mine is of a file, whose gains the arena does not know"):
        at_margin(own, 0.05)
    with pytest.raises(UsageError, match="indi with half its bandwidth does not tolerate 100 ms"):
        at_margin(entries()["indi"], 0.1)
