"""`quadlab COMMAND …`: parses the command line and runs one command.

Exit status: 0 done, 1 failed, 2 wrong usage. An error is one line on stderr.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import re
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import NoReturn

from quadlab.commands.parsing import parse
from quadlab.commands.table import commands, of_several, overview
from quadlab.interrupt import INTERRUPTED, end_at_interrupt, raise_at_interrupt
from quadlab.up.supervise import follow_parent
from quadrotor.checkout import DISTRIBUTION
from quadrotor.errors import QuadlabError, UsageError
from quadrotor.extensions import tell_problems

SHELLS = ("bash", "zsh", "tcsh")
COMPLETION = (
    "quadlab completion SHELL prints the completion for bash, zsh or tcsh: put "
    '`eval "$(quadlab completion bash)"` into ~/.bashrc'
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command named by `arguments` (default: sys.argv); return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    follow_parent()
    commands()  # asks all extensions
    tell_problems()
    if words == ["--version"]:
        print(f"quadlab {version(DISTRIBUTION)}")
        return 0
    if words in ([], ["--help"], ["-h"]):
        print(overview(), end="")
        return 0
    if len(words) == 1 and words[0] in of_several():  # without an action: its help
        words.append("--help")
    try:
        if words[0] == "completion":
            words = ["--tyro-print-completion", _shell(words[1:])]
        return parse(words).run()
    except QuadlabError as error:
        print(f"quadlab: {_as_line(error)}", file=sys.stderr)
        return 2 if isinstance(error, UsageError) else 1
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output, such as `head`, has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _as_line(error: QuadlabError) -> str:
    """Return an error as one line; a name of a file may have any characters."""
    return re.sub(r"[\x00-\x1f\x7f]+", " ", str(error))


def _shell(words: Sequence[str]) -> str:
    if len(words) != 1 or words[0] not in SHELLS:
        raise UsageError(f"completion {' '.join(words)!r} is not known; {COMPLETION}")
    return words[0]


def program() -> NoReturn:
    """Run `main` as a program, and exit without finalising the interpreter.

    A session of Zenoh may still be closing, and one of its threads that calls Python in the
    meantime aborts a process that is finalising.
    """
    try:
        raise_at_interrupt()
        if isinstance(sys.stdout, io.TextIOWrapper):  # for what a terminal cannot show
            sys.stdout.reconfigure(errors="backslashreplace")
        status = main()
    except SystemExit as stop:  # of --help, or of a signal that ends the page's process
        status = stop.code if isinstance(stop.code, int) else int(bool(stop.code))
    except KeyboardInterrupt:  # before or after main catches it
        status = INTERRUPTED
    end_at_interrupt()
    atexit._run_exitfuncs()
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    program()
