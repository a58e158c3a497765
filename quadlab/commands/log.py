"""`quadlab log ACTION LOG`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from quadlab.log_commands.export import Export
from quadlab.log_commands.fetch import Fetch
from quadlab.log_commands.import_ import Import
from quadlab.log_commands.info_and_check import Check, Info, Recover
from quadlab.log_commands.report import Report

Action = (
    Annotated[Info, tyro.conf.subcommand("info")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[Recover, tyro.conf.subcommand("recover")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[Fetch, tyro.conf.subcommand("fetch")]
    | Annotated[Import, tyro.conf.subcommand("import")]
    | Annotated[Report, tyro.conf.subcommand("report")]
)


@dataclass
class LogCommand:
    """Inspect, check, repair, fetch, import or export logs, and write reports."""

    action: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[Action]]
    """what to do"""

    def run(self) -> int:
        return self.action.run()
