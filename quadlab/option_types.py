"""Types of the command line's options, with what the help shows for them.

The help shows the docstrings of the options. tyro wraps them anew, but for a line that does not
begin with a letter: none of theirs does.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro


def optional(metavar: str | None = None, name: str | None = None) -> object:
    """Return the settings of an option whose default is not shown."""
    return tyro.conf.arg(metavar=metavar, name=name, help_behavior_hint="")


Flag = Annotated[bool, optional()]
Folder = Annotated[Path | None, optional("DIR")]
File = Annotated[Path | None, optional("FILE")]
Files = Annotated[tuple[Path, ...], optional("FILE [FILE …]")]
Names = Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME")]
Settings = Annotated[
    tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME=VALUE")
]
