"""`quadlab log ACTION LOG`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import tyro

from quadlab.commands.table import Command, actions, chosen
from quadlab.log_commands.fetch import Fetch
from quadlab.log_commands.info_and_check import Check, Info, Recover

_OWN: dict[str, type[Command]] = {"info": Info, "check": Check, "recover": Recover, "fetch": Fetch}
ACTIONS = _OWN | actions("log")
"""The actions by their words: those of quadlab itself, and those of extensions."""
if TYPE_CHECKING:
    Action = Command
else:
    Action = chosen(ACTIONS)


@dataclass
class LogCommand:
    """Inspect, check, repair, fetch, import or export logs, and write reports."""

    action: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[Action]]
    """what to do"""

    def run(self) -> int:
        return self.action.run()
