"""Plans, and campaigns flown by them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from extensions.campaigns.design import Cells
from extensions.campaigns.flights import Task, fly_task
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import read_plan
from extensions.campaigns.search.study import SearchWork
from extensions.campaigns.shard import WHOLE, Shard
from extensions.campaigns.table import MACHINE
from quadlab.__main__ import main

COMPILED = """
experiment = "closed_loop"
seeds = 5
[fixed]
"experiment.duration" = 2.0
"experiment.hover" = 0.5
"""
"""Flights of a millisecond."""

OWN = '''
import os
import signal
import time
from pathlib import Path

from console.experiments.client import Result
from quadrotor.parameters import Parameters, parameter


class Options(Parameters):
    case: str = parameter("good")
    """what happens"""
    height: float = parameter(1.0, unit="m", ge=0.0, le=3.0)
    """of nothing"""
    folder: str = parameter("")
    """with marks"""


class Cases:
    name, planned = "cases", 1.0

    def __init__(self):
        self.parameters = Options()

    def check(self): ...

    def fly(self, client):
        client.wait(0.1)
        case = self.parameters.case
        if case == "raises":
            raise ZeroDivisionError("no good")
        if case == "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        if case == "dies once":
            mark = Path(self.parameters.folder, "died")
            if not mark.exists():
                mark.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        if case == "hangs":
            time.sleep(1000)

    def evaluate(self, log):
        height = self.parameters.height
        fails = self.parameters.case == "fails"
        limits = {"height_m": 0.5 if fails else 2.0}
        return Result("failed" if fails else "passed", {"height_m": height}, limits)
'''
"""An experiment of a tenth of a second, in which anything can happen."""


class Bench:
    """A folder with plans, and the command line."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self._capsys = folder, capsys

    def plan(self, text: str, name: str = "plan.toml") -> Path:
        """Write a plan, next to the experiment of one's own."""
        (self.folder / "cases.py").write_text(OWN)
        (self.folder / name).write_text(text)
        return self.folder / name

    def quadlab(self, *words: object) -> tuple[int, str, str]:
        """Return status, output and complaint of `quadlab campaign`."""
        self._capsys.readouterr()
        status = main(["campaign", *map(str, words)])
        said = self._capsys.readouterr()
        return status, said.out, said.err

    def refused(self, *words: object) -> str:
        """Return the one line with which a command is refused."""
        status, _, said = self.quadlab(*words)
        assert status in (1, 2), said
        assert said.startswith("quadlab: ")
        assert said.count("\n") == 1, said
        return said.strip()

    def run(self, plan: Path, out: str, *words: object) -> CampaignFolder:
        """Fly a plan into a folder."""
        status, _, said = self.quadlab("run", plan, "--out", self.folder / out, *words)
        assert status in (0, 1), said
        return CampaignFolder(self.folder / out)

    def flown(self, text: str, out: str, shard: Shard = WHOLE) -> CampaignFolder:
        """Fly a plan in this process, without an engine."""
        file = read_plan(self.plan(text))
        folder = CampaignFolder.begun(self.folder / out, file, Cells(file.plan))
        mine = tuple(shard.indices(folder.flights))
        folder.add(fly_task(Task(file.text, str(folder.path), mine)), shard)
        folder.finish()
        return folder

    def searched(self, text: str, out: str, at_most: int = 1_000_000) -> CampaignFolder:
        """Fly a search in this process, or its first flights."""
        file = read_plan(self.plan(text))
        folder = CampaignFolder.begun(self.folder / out, file, Cells(file.plan))
        work = SearchWork(folder, WHOLE, [])
        left = at_most
        while left > 0 and (task := work.take()) is not None:
            found = fly_task(task)[:left]
            left -= len(found)
            work.finished(found)
        work.write()
        folder.finish()
        return folder


@pytest.fixture
def bench(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Bench:
    return Bench(tmp_path, capsys)


def rows(folder: CampaignFolder) -> Any:
    """Return the rows without what depends on the computer."""
    table = folder.table()
    return table.select([n for n in table.column_names if not n.startswith(MACHINE)])
