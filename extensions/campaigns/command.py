"""`quadlab campaign ACTION …`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import tyro

from quadlab.commands.table import Command, actions, chosen

if TYPE_CHECKING:
    Action = Command
else:
    Action = chosen(actions("campaign"))


@dataclass
class CampaignCommand:
    """Fly an experiment many times by a plan, on one computer or several, and judge the rows."""

    action: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[Action]]
    """what to do"""

    def run(self) -> int:
        return self.action.run()
