"""Schedules: when a fault is on, and how strongly, as a pure function of time and seed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from bearing_sim.sampling import SECOND_NS, Draws, spell_begin
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import Parameters, ParameterStore, parameter

LONGEST = 86400.0
"""Latest time, in s, that a schedule can name; an end there means that the fault stays on."""


@dataclass(frozen=True, slots=True)
class Moment:
    """A fault that is on.

    Attributes:
        level: 0 to 1, its share of full strength.
        elapsed: s since it came on.
        spell_ns: when it came on, on its own clock; another value means that it came on again.
    """

    level: float
    elapsed: float
    spell_ns: int


class Schedule(Parameters):
    """The words of a schedule. A word that Python reserves has an underscore here."""

    from_: float = parameter(0.0, unit="s", ge=0, le=LONGEST)
    """when the fault comes on, after it was set: at the start, or in flight"""
    to: float = parameter(LONGEST, unit="s", ge=0, le=LONGEST)
    """when it ends; without it the fault stays"""
    for_: float = parameter(0.0, unit="s", ge=0, le=LONGEST)
    """how long it stays on, in place of `to`; with `every` in each period"""
    ramp: float = parameter(0.0, unit="s", ge=0, le=LONGEST)
    """time in which its strength grows from nothing to full"""
    every: float = parameter(0.0, unit="s", ge=0, le=LONGEST)
    """period with which it comes on again for the time `for`, like that of a trajectory's lap"""
    share: float = parameter(1.0, ge=0, le=1)
    """share of the time that it is on; below 1 at random, with one spell at a random place in each
    period of `spell`/`share`"""
    spell: float = parameter(1.0, unit="s", ge=0.001, le=LONGEST)
    """how long each of these spells is"""

    def check_together(self) -> None:
        if self.for_ and not self.every and self.to < LONGEST:
            raise OutOfBoundsError("it has both 'for' and 'to': give one of them")
        if self.begin_ns >= self.end_ns:
            raise OutOfBoundsError(
                f"it never begins: from = {self.from_:g} s is not before its end at "
                f"{self.end_ns / SECOND_NS:g} s"
            )
        if self.share == 0.0:
            raise OutOfBoundsError("it never begins: share = 0")
        if self.every and self.share < 1.0:
            raise OutOfBoundsError("it is both periodic and random: give 'every' or 'share'")
        if self.every and not 0 < self.for_ < self.every:
            raise OutOfBoundsError(
                f"every = {self.every:g} s needs 'for', longer than 0 and shorter than this "
                f"period, not {self.for_:g} s"
            )

    @property
    def begin_ns(self) -> int:
        """Return when it begins, in ns on the fault's clock."""
        return round(self.from_ * SECOND_NS)

    @property
    def end_ns(self) -> int:
        """Return when it ends for good, in ns on the fault's clock."""
        lasts = self.for_ and not self.every
        return round((self.from_ + self.for_ if lasts else self.to) * SECOND_NS)

    def at(self, t_ns: int, seed: int, stream: int) -> Moment | None:
        """Return the moment at `t_ns` on the fault's clock, None while the fault is off.

        Args:
            seed: seed of random schedules.
            stream: any integer that tells this fault's random numbers from those of others.
        """
        begin_ns = self.begin_ns
        if not begin_ns <= t_ns < self.end_ns:
            return None
        if self.every:
            period_ns = round(self.every * SECOND_NS)
            begin_ns += (t_ns - begin_ns) // period_ns * period_ns
            if t_ns - begin_ns >= round(self.for_ * SECOND_NS):
                return None
        elif self.share < 1.0:
            found_ns = spell_begin(seed, stream, t_ns, self.share, round(self.spell * SECOND_NS))
            if found_ns is None:
                return None
            begin_ns = max(begin_ns, found_ns)
        elapsed = (t_ns - begin_ns) / SECOND_NS
        level = min(1.0, elapsed / self.ramp) if self.ramp else 1.0
        return Moment(level, elapsed, begin_ns)


WORDS = {
    one.name.rstrip("_"): replace(one, name=one.name.rstrip("_"))
    for one in ParameterStore(Schedule()).descriptions()
}
"""Descriptions of a schedule's words, as they are written."""


def stream_of(name: str) -> int:
    """Return an integer of a fault's name, the same in every process."""
    return Draws(*name.encode()).whole()
