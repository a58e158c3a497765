"""`quadlab arena`: every law on every course under every disturbance."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

from quadlab.option_types import File, Folder, optional
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from extensions.laws.arena.cells import Entry
    from extensions.laws.arena.results import Cell


@dataclass
class Arena:
    """Fly control laws on courses under disturbances in compiled code, and print tables of their
    errors."""

    laws: Annotated[str, optional("NAMES")] = ""
    """names separated by spaces, also of your own laws (default: all but those)"""
    courses: Annotated[str, optional("NAMES")] = ""
    """names separated by semicolons (default: all twelve)"""
    seeds: int = 12
    """flights of each law in each cell, of nmpc a third; all laws fly the same seeds"""
    tuned: Folder = None
    """folder with the campaigns tune_NAME, whose best trials are the settings (default: the laws'
    own values)"""
    equal_margin: bool = False
    """scale the gains of each law by one factor until it tolerates as much latency as the first"""
    plugins: Folder = None
    """folder of your own laws (default: plugins in the data folder)"""
    page: File = None
    """Markdown file whose tables are replaced"""
    out: File = None
    """file for the error of each flight (.json, .csv), or for the table of errors (.tex)"""

    def run(self) -> int:
        from extensions.laws.arena import table
        from extensions.laws.arena.cells import chosen
        from extensions.laws.arena.courses import chosen_courses
        from extensions.laws.arena.flights import fly_arena, tick_time
        from extensions.laws.arena.margins import at_equal_margin
        from extensions.laws.arena.own_laws import own_laws
        from extensions.laws.arena.tuned import tuned
        from quadlab.data_folder import data_folder
        from vehicle.laws.offer import offer_laws
        from vehicle.processes.config import PLUGINS

        if self.seeds < 2:
            raise UsageError(f"--seeds {self.seeds}: allowed are 2 or more; an interval needs them")
        if self.page is not None:
            table.check_page(self.page)
        if self.out is not None:
            table.check_out(self.out)
        folder = self.plugins or data_folder(None) / PLUGINS
        offer_laws(folder)
        there = chosen_courses(self.courses)
        laws, settings = chosen(self.laws, own_laws(folder)), ""
        if self.tuned is not None:
            laws, budget = tuned(laws, self.tuned)
            settings = f"; settings of each law by {budget}"
        if self.equal_margin:
            laws, margin = at_equal_margin(laws)
            settings = f"{settings}; {margin}"
        ticks = {one.name: tick_time(one) for one in laws}
        flown = fly_arena(laws, self.seeds, there, lambda line: print(line, file=sys.stderr))
        cells = [replace(cell, tick=ticks[cell.entry]) for cell in flown]
        lines = self._tables(laws, cells, settings)
        for one in laws:
            for why in one.own.failures if one.own else ():
                print(f"quadlab: {one.name} was out, and crashed: {why}", file=sys.stderr)
        if self.out is not None:
            table.write_out(self.out, cells)
        if self.page is not None:
            table.write_into(self.page, lines)
        else:
            print("\n".join(lines))
        return 0

    def _tables(self, laws: list[Entry], cells: list[Cell], settings: str) -> list[str]:
        from extensions.laws.arena import table
        from extensions.laws.arena.flights import tolerated_latency

        has_base = any(one.entry == laws[0].name == "geometric" for one in cells)
        fewer = {one.entry: len(one.rms) for one in cells if len(one.rms) < self.seeds}
        seeds = ", ".join([f"{self.seeds} seeds", *(f"{n} for {law}" for law, n in fewer.items())])
        lines = ["", f"Median position error of {seeds}, mm rms{settings}:", ""]
        lines += table.errors_table(cells)
        if has_base and len(laws) > 1:
            lines += ["", "The same over that of `geometric`, seed by seed:", ""]
            lines += table.ratios_table(cells)
        ticks = {cell.entry: cell.tick for cell in cells}
        facts = [table.Facts(one.name, tolerated_latency(one), ticks[one.name]) for one in laws]
        lines += ["", "How often each law is the first, or near it, among all and among those that"]
        lines += ["tolerate as much latency on the 8 in 8 s:", ""]
        return [*lines, *table.facts_table(cells, facts), ""]
