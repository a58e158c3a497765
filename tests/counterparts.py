"""Programs that some tests need beyond Python and the extra `dev`; each is declared here, once.

A test names what it needs by `@pytest.mark.needs("chromium")`, or by a fixture that a counterpart
provides. `scripts/test` leaves these tests out; `scripts/test --complete` runs them, and refuses to
start while a counterpart is missing or does not work.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.firmware import chip
from benchmarks.impairment.namespace import make_end
from quadrotor.errors import StorageError

ROOT = Path(__file__).parents[1]
CHROMIUMS = ("chromium-headless-shell", "chromium")
"""Debian's browsers; the shell draws the same with half the work, as it has no window."""
NODE_FROM = (20, 19)
"""Oldest node that jsdom supports, as package.json says; Debian has it from 13 on."""
APT = "apt install "
START_LIMIT_S = 60.0
"""Time limit for a counterpart to start, s, which only a broken program needs."""


@dataclass(frozen=True, slots=True)
class Counterpart:
    """A program that tests need.

    Attributes:
        title: its name for people.
        install: the command that installs it on Debian.
        problem: returns why it cannot be used on this machine; empty where it works.
        programs: its programs in PATH, as patterns, which a bare machine does not have.
        fixture: the fixture that provides it; tests that use the fixture need it.
        of_kernel: whether a kernel may forbid it, so that its tests are skipped there.
    """

    title: str
    install: str
    problem: Callable[[], str]
    programs: tuple[str, ...] = ()
    fixture: str = ""
    of_kernel: bool = False


def chromium() -> str | None:
    """Return the path of the browser for the tests of the page, None where there is none."""
    return next(filter(None, map(shutil.which, CHROMIUMS)), None)


def _answer(words: Sequence[str | Path]) -> tuple[str, str]:
    """Run a program; return its output, and why it failed, each empty where there is none."""
    name = Path(words[0]).name
    if shutil.which(words[0]) is None:
        return "", f"there is no {name}"
    try:
        done = subprocess.run(
            words,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            timeout=START_LIMIT_S,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return "", f"{name} does not start: {error}"
    if done.returncode:
        last = (done.stderr.strip() or "no message").splitlines()[-1]
        return "", f"{name} does not work: status {done.returncode}, {last}"
    return done.stdout, ""


def _chromium() -> str:
    found = chromium()
    if found is None:
        return f"there is neither {' nor '.join(CHROMIUMS)}"
    with tempfile.TemporaryDirectory() as profile:
        words = [found, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
        shown, problem = _answer([*words, "--dump-dom", "data:text/html,<p>it draws</p>"])
    return problem or ("" if "it draws" in shown else f"{found} does not show a page")


def _node() -> str:
    said, problem = _answer(["node", "--version"])
    if problem:
        return problem
    numbers = re.match(r"v(\d+)\.(\d+)", said)
    if numbers is None:
        return f"node says {said.strip()!r} when asked for its version"
    if tuple(map(int, numbers.groups())) < NODE_FROM:
        oldest = ".".join(map(str, NODE_FROM))
        return f"node {said.strip()} is older than {oldest}, which Debian has from 13 on"
    return _answer([ROOT / "scripts" / "setup_node"])[1]


def _compilers() -> str:
    for compiler in ("gcc", "g++"):
        with tempfile.TemporaryDirectory() as folder:
            language = "c" if compiler == "gcc" else "c++"
            source = Path(folder) / "empty"
            source.write_text("#include <math.h>\nint main(void) { return 0; }\n")
            words = [compiler, "-x", language, source, "-o", source.with_suffix(".out")]
            if problem := _answer(words)[1]:
                return problem
    return _answer(["make", "--version"])[1]


def _betaflight() -> str:
    from extensions.betaflight.simulated.process import FIRMWARE

    return "" if FIRMWARE.exists() else "Betaflight 4.6 is not built in the cache folder"


def _octave() -> str:
    return _answer(["octave-cli", "--quiet", "--eval", "pkg load sockets"])[1]


def _namespaces() -> str:
    try:
        make_end("10.91.0.1").close()
    except StorageError as error:
        return str(error)
    return ""


COUNTERPARTS = {
    "chromium": Counterpart(
        "Chromium",
        f"{APT}chromium-headless-shell",
        _chromium,
        programs=("chromium*", "google-chrome*"),
        fixture="chromium_path",
    ),
    "node": Counterpart(
        "node",
        f"{APT}nodejs npm",
        _node,
        programs=("node", "nodejs", "npm", "npx"),
        fixture="node_path",
    ),
    "gcc": Counterpart(
        "the C compilers",
        f"{APT}gcc g++ make libc6-dev",
        _compilers,
        programs=("gcc*", "g++*", "cc", "c++", "c?9", "clang*", "make", "gmake", "*-linux-gnu-*"),
    ),
    "simavr": Counterpart(
        "simavr",
        f"{APT}gcc-avr avr-libc simavr libsimavr-dev",
        chip.missing,
        programs=("avr-*", "simavr*"),
    ),
    "betaflight": Counterpart("Betaflight", "scripts/betaflight", _betaflight),
    "octave": Counterpart("Octave", f"{APT}octave octave-sockets", _octave, programs=("octave*",)),
    "namespaces": Counterpart(
        "network namespaces", f"{APT}iproute2 util-linux", _namespaces, of_kernel=True
    ),
}
"""The counterparts, by the word of the mark `needs`."""


def problems(words: Iterable[str]) -> tuple[list[str], dict[str, str]]:
    """Return a line for each missing counterpart, and the reasons of those a kernel forbids."""
    found = {word: COUNTERPARTS[word].problem() for word in sorted(words)}
    found = {word: problem for word, problem in found.items() if problem}
    forbidden = {word: problem for word, problem in found.items() if COUNTERPARTS[word].of_kernel}
    lines = [
        f"{COUNTERPARTS[word].title}: {problem}; on Debian: {COUNTERPARTS[word].install}"
        for word, problem in found.items()
        if word not in forbidden
    ]
    return lines, forbidden


def left_out_line(left_out: Counter[str]) -> str:
    """Return the line of a bare run: how many tests of which counterparts it has left out."""
    words = [word for word in COUNTERPARTS if left_out[word]]
    counts = ", ".join(
        f"{COUNTERPARTS[word].title} ({left_out[word]} test{'s' * (left_out[word] != 1)})"
        for word in words
    )
    commands = [COUNTERPARTS[word].install for word in words]
    packages = [command.removeprefix(APT) for command in commands if command.startswith(APT)]
    installing = [f"`{command}`" for command in commands if not command.startswith(APT)]
    if packages:
        installing.insert(0, f"`{APT}{' '.join(packages)}`")
    return (
        f"Left out, because they need more than Python: {counts}. {' and '.join(installing)} "
        f"install{'s' * (len(installing) == 1)} these; `scripts/test --complete` then runs the rest"
    )
