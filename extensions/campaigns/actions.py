"""The actions of `quadlab campaign`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.option_types import File, Flag, Folder, optional
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from extensions.campaigns.folder import CampaignFolder
    from extensions.campaigns.run import Engine

PlanPath = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PLAN")]
Campaign = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
Out = Annotated[Path, tyro.conf.arg(metavar="DIR")]
Workers = Annotated[int, optional("N")]
Address = Annotated[str, optional("ADDRESS")]
ShardText = Annotated[str, optional("I/N")]


@dataclass
class New:
    """Write a plan with comments to start from, and its schema for editors."""

    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("plan.toml")
    """the file"""

    def run(self) -> int:
        from extensions.campaigns.new_plan import write

        for path in write(self.out):
            print(path)
        return 0


@dataclass
class Check:
    """Check each row of a plan, and print what it flies and how long that may take."""

    plan: PlanPath
    """the plan"""

    def run(self) -> int:
        from extensions.campaigns.run import Engine, checked, told

        _, settings = checked(self.plan)
        print("\n".join(told(settings, Engine().processes)))
        return 0


@dataclass
class Run:
    """Fly a plan, or the rest of it if the folder has some of its rows."""

    plan: PlanPath
    """the plan"""
    out: Out
    """folder of the campaign"""
    workers: Workers = 0
    """processes of this computer (default: one a processor)"""
    dask: Address = ""
    """scheduler of Dask that has the workers, as tcp://HOST:8786"""
    shard: ShardText = ""
    """only every N-th flight, from the I-th: a part for one job of an array (quadlab campaign merge
    joins them)"""

    def run(self) -> int:
        from extensions.campaigns.folder import CampaignFolder
        from extensions.campaigns.run import checked, fly, told

        engine = _engine(self.workers, self.dask, self.shard)
        file, settings = checked(self.plan)
        print("\n".join(told(settings, engine.processes)), flush=True)
        engine.check()
        return fly(CampaignFolder.begun(self.out, file, settings.cells), engine)


@dataclass
class Resume:
    """Fly the rest of a campaign that was stopped."""

    folder: Campaign
    """folder of the campaign"""
    workers: Workers = 0
    """processes of this computer (default: one a processor)"""
    dask: Address = ""
    """scheduler of Dask that has the workers, as tcp://HOST:8786"""
    shard: ShardText = ""
    """only every N-th flight, from the I-th"""

    def run(self) -> int:
        from extensions.campaigns.folder import CampaignFolder
        from extensions.campaigns.run import fly

        engine = _engine(self.workers, self.dask, self.shard)
        folder = CampaignFolder(self.folder)
        folder.check_alike()
        engine.check()
        return fly(folder, engine)


@dataclass
class Merge:
    """Join the shards of a campaign into the first folder: one table, in the order of the index."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, optional("DIR …")]
    """folders of the same campaign"""

    def run(self) -> int:
        from extensions.campaigns.merge import merge

        if not self.folders:
            raise UsageError("quadlab campaign merge DIR … needs the folders of the shards")
        print("\n".join(merge(self.folders)))
        return 0


@dataclass
class Show:
    """Print shares and quantiles of a campaign, and the command that flies each failed row."""

    folder: Campaign
    """folder of the campaign"""
    json: Flag = False
    """print everything as JSON"""
    report: File = None
    """write a report with figures: one HTML file"""
    figures: Folder = None
    """write the figures as SVG and PDF, with their fonts"""

    def run(self) -> int:
        from extensions.campaigns.folder import CampaignFolder
        from extensions.campaigns.search import told as search
        from extensions.campaigns.summary import summarize, told

        folder = CampaignFolder(self.folder)
        if self.report is not None or self.figures is not None:
            return self._write(folder)
        table = folder.table(figures_only=True)
        summary = summarize(folder, table)
        if self.json:
            print(json.dumps(summary))
            return 0
        lines = told(summary)
        if folder.plan.plan.search is not None:
            lines += search.told(search.outcome(folder, table))
        print("\n".join(lines))
        return 0

    def _write(self, folder: CampaignFolder) -> int:
        from extensions.campaigns.analysis.report import write_figures, write_report

        if self.report is not None:
            write_report(folder, self.report)
            print(self.report)
        if self.figures is not None:
            for one in write_figures(folder, self.figures):
                print(one)
        return 0


@dataclass
class Compare:
    """Compare two campaigns flight by flight, paired by seed and factors."""

    first: Campaign
    """folder of the campaign that is compared with"""
    second: Campaign
    """folder of the other one"""
    limit: Flag = False
    """end with status 1 if the second is worse than noise explains"""

    def run(self) -> int:
        from extensions.campaigns.compare import compare, told
        from extensions.campaigns.folder import CampaignFolder

        found = compare(CampaignFolder(self.first), CampaignFolder(self.second))
        print("\n".join(told(found)))
        return 1 if self.limit and found["is_worse"] else 0


def _engine(workers: int, dask: str, shard: str) -> Engine:
    from extensions.campaigns.run import Engine
    from extensions.campaigns.shard import WHOLE, parse_shard

    return Engine(workers, dask, parse_shard(shard) if shard else WHOLE)
