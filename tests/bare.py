"""Run a command as on a machine that has Python alone: `python -m tests.bare scripts/test`.

The programs of `tests/counterparts.py` are not in its PATH, and its home and caches are empty.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from fnmatch import fnmatch
from pathlib import Path

from tests.counterparts import COUNTERPARTS

HIDDEN = tuple(pattern for part in COUNTERPARTS.values() for pattern in part.programs)
FOLDERS = ("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME")
"""Variables of folders that otherwise are below the home."""


def link_programs(search: Iterable[str], folder: Path) -> None:
    """Link the programs of a search path into a folder, the first of each name, none of HIDDEN."""
    for place in filter(os.path.isdir, search):
        for program in sorted(os.scandir(place), key=lambda entry: entry.name):
            link = folder / program.name
            hidden = any(fnmatch(program.name, pattern) for pattern in HIDDEN)
            if not hidden and not os.path.lexists(link) and os.access(program.path, os.X_OK):
                link.symlink_to(program.path)


def main(words: list[str]) -> int:
    """Run the command; return its exit status."""
    if not words:
        print("give a command, as in: python -m tests.bare scripts/test", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="quadlab-bare-") as made:
        programs, home = Path(made, "bin"), Path(made, "home")
        programs.mkdir()
        home.mkdir()
        link_programs(os.environ.get("PATH", os.defpath).split(os.pathsep), programs)
        kept = {name: value for name, value in os.environ.items() if name not in FOLDERS}
        environment = {**kept, "PATH": str(programs), "HOME": str(home)}
        return subprocess.run(words, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
