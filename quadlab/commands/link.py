"""`quadlab link ACTION …`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from quadlab.link_commands.enrol import Enrol, Observer, Pilot
from quadlab.link_commands.known import Forget, List
from quadlab.link_commands.test import Test

Action = (
    Annotated[Enrol, tyro.conf.subcommand("enrol")]
    | Annotated[Observer, tyro.conf.subcommand("observer")]
    | Annotated[Pilot, tyro.conf.subcommand("pilot")]
    | Annotated[List, tyro.conf.subcommand("list")]
    | Annotated[Forget, tyro.conf.subcommand("forget")]
    | Annotated[Test, tyro.conf.subcommand("test")]
)


@dataclass
class LinkCommand:
    """Enrol vehicles and further stations, list vehicles, test a link."""

    action: tyro.conf.OmitArgPrefixes[tyro.conf.OmitSubcommandPrefixes[Action]]
    """what to do"""

    def run(self) -> int:
        return self.action.run()
