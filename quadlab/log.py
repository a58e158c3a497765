"""`quadlab log ACTION LOG`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from quadlab.log_commands.export import Export
from quadlab.log_commands.look import Check, Info
from quadlab.log_commands.recover import Recover

Action = (
    Annotated[Info, tyro.conf.subcommand("info")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[Recover, tyro.conf.subcommand("recover")]
    | Annotated[Export, tyro.conf.subcommand("export")]
)


@dataclass
class LogCommand:
    """Look at a log, check it, mend it, or write it as tables."""

    action: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[Action]]
    """what to do"""

    def run(self) -> int:
        return self.action.run()
