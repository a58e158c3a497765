"""`quadlab arena`: every law on every course under every disturbance."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from quadrotor.errors import UsageError


@dataclass
class Arena:
    """Fly control laws on courses under disturbances in compiled code, and print tables of their
    errors."""

    laws: str = ""
    """names separated by spaces (default: all)"""
    seeds: int = 12
    """flights of each law in each cell; all laws fly the same seeds"""
    tuned: Path | None = None
    """folder with the campaigns tune_NAME, whose best trials are the settings (default: the laws'
    own values)"""
    page: Path | None = None
    """Markdown file whose tables are replaced"""
    out: Path | None = None
    """file for the error of each flight (.json, .csv), or for the table of errors (.tex)"""

    def run(self) -> int:
        from extensions.laws.arena import table
        from extensions.laws.arena.cells import chosen
        from extensions.laws.arena.flights import fly_arena, tick_time, tolerated_latency
        from extensions.laws.arena.tuned import tuned

        if self.seeds < 2:
            raise UsageError(f"--seeds {self.seeds}: allowed are 2 or more; an interval needs them")
        if self.page is not None:
            table.check_page(self.page)
        if self.out is not None:
            table.check_out(self.out)
        laws, budget = chosen(self.laws), ""
        if self.tuned is not None:
            laws, budget = tuned(laws, self.tuned)
        cells = list(fly_arena(laws, self.seeds, lambda line: print(line, file=sys.stderr)))
        has_base = any(one.entry == laws[0].name == "geometric" for one in cells)
        settings = f"; settings of each law by {budget}" if budget else ""
        lines = ["", f"Median position error of {self.seeds} seeds, mm rms{settings}:", ""]
        lines += table.errors_table(cells)
        if has_base and len(laws) > 1:
            lines += ["", "The same over that of `geometric`, seed by seed:", ""]
            lines += table.ratios_table(cells)
        facts = [(one.name, tolerated_latency(one), tick_time(one.law)) for one in laws]
        lines += ["", "Latency tolerated on the 8 in 8 s, and the time of a tick:", ""]
        lines += [*table.facts_table(facts), ""]
        if self.out is not None:
            table.write_out(self.out, cells)
        if self.page is not None:
            table.write_into(self.page, lines)
        else:
            print("\n".join(lines))
        return 0
