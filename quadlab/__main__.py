"""`quadlab COMMAND …`: parses the command line and runs one command.

Exit status: 0 done, 1 failed, 2 wrong usage. An error is one line on stderr.
"""

from __future__ import annotations

import atexit
import contextlib
import difflib
import io
import os
import re
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import NoReturn

from quadlab.commands.examples import examples_of
from quadlab.commands.table import COMMANDS, Command, overview
from quadlab.interrupt import INTERRUPTED, end_at_interrupt, raise_at_interrupt
from quadlab.up.supervise import follow_parent
from quadrotor.errors import QuadlabError, UsageError

OF_SEVERAL = ("log", "link")
"""Commands that need a subcommand: without one they print their help."""
SHELLS = ("bash", "zsh", "tcsh")
COMPLETION = (
    "quadlab completion SHELL prints the completion for bash, zsh or tcsh: put "
    '`eval "$(quadlab completion bash)"` into ~/.bashrc'
)

WORDS = (
    (r"Expected 1 values", "Expected one value"),
    (r"argument 'action\.", "argument '"),
    (r"Error parsing (\S+): ", r"\1: "),
    (r"invalid literal for int\(\) with base 10: ('.*')", r"\1 is not a whole number"),
    (r"no type matching \S+ could be instantiated from \['(.*?)'\].*", r"'\1' is not a number"),
    (r"could not convert string to float: ('.*')", r"\1 is not a number"),
)
"""What tyro and Python say, as patterns, and our words for it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command named by `arguments` (default: sys.argv); return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    follow_parent()
    if words == ["--version"]:
        print(f"quadlab {version('quadlab')}")
        return 0
    if words in ([], ["--help"], ["-h"]):
        print(overview(), end="")
        return 0
    if words in ([name] for name in OF_SEVERAL):
        words.append("--help")
    try:
        if words[0] == "completion":
            words = ["--tyro-print-completion", _shell(words[1:])]
        return parse(words).run()
    except UsageError as error:
        print(f"quadlab: {error}", file=sys.stderr)
        return 2
    except QuadlabError as error:
        print(f"quadlab: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output, such as `head`, has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


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


def parse(words: Sequence[str]) -> Command:
    """Return the command with its options. Raises UsageError, or SystemExit(0) after --help."""
    given = _one_setting_each(words)
    command = _parsed(given)
    if isinstance(command, str) and command.startswith("Missing value for argument '"):
        # tyro counts the arguments before it looks at the options
        first = next((k for k, word in enumerate(given) if word.startswith("-")), len(given))
        filled = _parsed([*given[:first], "x", *given[first:]])
        if isinstance(filled, str) and filled.startswith(("Unrecognized", "quadlab ")):
            command = filled
    if isinstance(command, str):
        raise UsageError(command)
    return command


def _parsed(words: list[str]) -> Command | str:
    """Return the command, or what is wrong with the words. Raises SystemExit(0) after --help."""
    import tyro

    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            command: Command = tyro.extras.subcommand_cli_from_dict(
                dict(COMMANDS), prog="quadlab", config=(tyro.conf.FlagCreatePairsOff,), args=words
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            print(examples_of(words[0]), end="")
            raise
        return _one_line(complaint.getvalue())
    return command


def _one_setting_each(words: Sequence[str]) -> list[str]:
    """Return `--set a=1 b=2` as `--set a=1 --set b=2`, as people write both."""
    out: list[str] = []
    setting = False
    for word in words:
        if setting and not word.startswith("-") and "=" in word and out[-1] != "--set":
            out.append("--set")
        setting = word == "--set" or (setting and "=" in word)
        out.append(word)
    return out


def _one_line(boxed: str) -> str:
    """Return tyro's boxed complaint as one sentence: the mistake and the nearest allowed word."""
    sections: list[list[str]] = [[]]
    for framed in _plain(boxed).splitlines()[1:]:
        line = framed.strip("│| ")
        if re.fullmatch(r"[╭╮╰╯─+-]+", line):
            sections.append([])
        elif line:
            sections[-1].append(line)
    first, *others = [section for section in sections if section]
    said = " ".join(first)
    if misplaced := re.match(
        r"Unrecognized or misplaced options: (--\S+) \(applied to (.+?)\)", said
    ):
        return _of_another(*misplaced.groups())
    for pattern, words in WORDS:
        said = re.sub(pattern, words, said)
    for section in others:
        if section[0].startswith(("Perhaps you meant", "Available subcommands")):
            said += "; " + " ".join(section[:2])
    return said.rstrip(".") + _nearest(said) + "; --help lists what is allowed"


def _plain(text: str) -> str:
    """Return a text without the codes of colours."""
    return re.sub(r"\x1b\[[0-9;]*m", "", text)


def _of_another(option: str, command: str) -> str:
    """Return the complaint about an option that only other commands have, with this one's own."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        _parsed([*command.split()[1:], "--help"])
    own = re.findall(r"(?m)^[│ ] (--[\w-]+)", _plain(text.getvalue()))
    return f"{command} has no {option}: its options are {', '.join(own)}; --help explains them"


def _nearest(said: str) -> str:
    """Return the allowed words nearest to one that is not allowed; "" if none is near."""
    wrong = re.search(r"(?:Unrecognized options: |invalid choice ')([\w-]+)", said)
    allowed = re.search(r"(?:Available subcommands: |Expected one of [({])([^;)}]+)", said)
    if not wrong or not allowed or "Perhaps you meant" in said:
        return ""
    words = [word.strip(" '") for word in allowed[1].split(",")]
    near = difflib.get_close_matches(wrong[1].lower(), words, n=2, cutoff=0.5)
    return f"; did you mean {' or '.join(near)}?" if near else ""


if __name__ == "__main__":
    program()
