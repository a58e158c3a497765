"""The words of a command line as a command with its options, and what is wrong with them."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Sequence

from quadlab.commands.table import Command, commands, examples_of, is_at_station
from quadrotor.checkout import DISTRIBUTION
from quadrotor.errors import UsageError
from quadrotor.similar_names import did_you_mean

WORDS = (
    (r"Expected 1 values", "Expected one value"),
    (r"argument 'action\.", "argument '"),
    (r"Error parsing (\S+): ", r"\1: "),
    (r"invalid literal for int\(\) with base 10: ('.*')", r"\1 is not a whole number"),
    (r"no type matching \S+ could be instantiated from \['(.*?)'\].*", r"'\1' is not a number"),
    (r"could not convert string to float: ('.*')", r"\1 is not a number"),
)
"""Patterns of the messages of tyro and Python, each with the words that replace it."""


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

    if words[0] not in commands() and not words[0].startswith("-"):
        return _no_command(words[0])
    complaint = io.StringIO()
    known, config = commands().get(words[0]), (tyro.conf.FlagCreatePairsOff,)
    try:
        with contextlib.redirect_stderr(complaint):
            command: Command
            if known is not None:  # nothing of other commands is imported
                command = tyro.cli(
                    known.load(), prog=f"quadlab {words[0]}", config=config, args=words[1:]
                )
            else:
                every = {name: one.load() for name, one in commands().items()}
                command = tyro.extras.subcommand_cli_from_dict(
                    every, prog="quadlab", config=config, args=words
                )
    except SystemExit as stop:
        if stop.code in (0, None):
            print(examples_of(words[0]), end="")
            raise
        return _one_line(complaint.getvalue())
    return command


def _no_command(word: str) -> str:
    if is_at_station(word):
        return (
            f"the command {word} is not in {DISTRIBUTION}, the part of quadlab for the vehicle's "
            "computer; run it where quadlab is installed"
        )
    meant = did_you_mean(word.lower(), commands(), before="; ", cutoff=0.5)
    there_are = ", ".join(commands())
    return f"there is no command {word!r}; there are {there_are}{meant}; --help explains them"


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
    return did_you_mean(wrong[1].lower(), words, before="; ", cutoff=0.5)
