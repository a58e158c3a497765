"""`quadlab link ACTION …`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import tyro

from quadlab.commands.table import Command, actions, chosen
from quadlab.link_commands.enrol import Enrol, Observer, Pilot
from quadlab.link_commands.known import Forget, List

_OWN: dict[str, type[Command]] = {
    "enrol": Enrol,
    "observer": Observer,
    "pilot": Pilot,
    "list": List,
    "forget": Forget,
}
ACTIONS = _OWN | actions("link")
"""The actions by their words: those of quadlab itself, and those of extensions."""
if TYPE_CHECKING:
    Action = Command
else:
    Action = chosen(ACTIONS)


@dataclass
class LinkCommand:
    """Enrol vehicles and further stations, list vehicles, test a link."""

    action: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[Action]]
    """what to do"""

    def run(self) -> int:
        return self.action.run()
