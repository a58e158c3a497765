"""Types of the command line's options, with what the help shows for them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import tyro


def optional(metavar: str | None = None, name: str | None = None) -> Any:
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


@contextmanager
def wrapped_help() -> Iterator[None]:
    """Let tyro wrap the help texts itself: it would also break them where the source does."""
    import docstring_parser

    parse = docstring_parser.parse_from_object

    def joined(
        command: Any, style: docstring_parser.DocstringStyle = docstring_parser.DocstringStyle.AUTO
    ) -> docstring_parser.Docstring:
        found = parse(command, style)
        for one in found.params:
            one.description = " ".join((one.description or "").split())
        return found

    docstring_parser.parse_from_object = joined  # type: ignore[assignment]  # names of parameters
    try:
        yield
    finally:
        docstring_parser.parse_from_object = parse
