"""Flights of whole laboratories in which processes die, freeze or starve, and clocks are set.

    python -m benchmarks laboratory_faults [--quick | --smoke]
    python -m benchmarks.safety.laboratory_faults [--minutes 40] [--only killed,clock] [--json FILE]
                                                  [--keep FOLDER]
    unshare -n sh -c 'ip link set lo up; python -m benchmarks.safety.laboratory_faults --only link'

In a network namespace of its own, as in the last line, the link between its processes fails, too.
With --json a long run is flown in parts: cases that FILE has are not repeated. With --keep the logs
of cases that are not good are copied there.

Each case is one fault in one phase of a flight of `quadlab up`, whose data folder and /dev/shm are
small file systems of their own. The person at the page tries to land, as one would. A case is good
if the vehicle touches down softly and can be armed again, or is on the ground and its laboratory
says why; every log of it can be read, and no process outlives its laboratory.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.safety.flight_logs import logs, touch_down
from benchmarks.safety.laboratory import LOOK, Laboratory
from benchmarks.safety.site import Site
from benchmarks.safety.starving import FAULTS, FROZEN, fault
from quadrotor.errors import QuadlabError

EMERGENCY = "hovering, Emergency land"
PHASES = (EMERGENCY, "hovering", "climbing", "figure 8", "landing", "on the ground", "armed")
EVENTS = "/api/events"
SOFT = 0.5
"""Largest vertical speed, in m/s, at touch-down."""
WITHIN = 90.0
"""Time, in s of a clock on the wall, to be down and ready again; simulated time waits for a busy
computer."""


@dataclass
class Case:
    """One fault in one phase; `impact` in m/s, `took` in s until it was ready again, and `began`
    by the steady clock.

    `answered` is the time, in s, from the press of Emergency land to its acknowledgement.
    """

    fault: str
    phase: str
    began: float = 0.0
    impact: float = math.nan
    took: float = math.nan
    answered: float = math.nan
    ready: bool = False
    down: bool = False
    said: str = ""
    unreadable: list[str] = field(default_factory=list)
    why: str = ""  # what was wrong

    @property
    def is_good(self) -> bool:
        return not self.why


def reach(lab: Laboratory, phase: str) -> None:
    """Bring the vehicle from the ground into a phase. Raises QuadlabError."""
    if phase == "on the ground":
        return
    if phase == "armed":
        lab.arm()
        return
    lab.take_off(height=1.5 if phase == "climbing" else 1.0, speed=0.5)
    lab.until("the air", lambda: lab.status().get("airborne"))
    if phase == "climbing":
        time.sleep(1.0)
        return
    lab.until("hover", lambda: lab.status().get("behavior") == "hover")
    if phase == "figure 8":
        eight = {"trajectory": "figure_eight", "laps": 3}
        lab.until("the 8", lambda: lab.starts("follow_trajectory", **eight))
        time.sleep(3.0)
    elif phase == "landing":
        lab.until("land", lambda: lab.starts("land"))
        time.sleep(0.7)


def fly(site: Site, name: str, phase: str, keep: Path | None = None) -> Case:
    """Fly one case; keep its logs in a folder if it is not good."""
    case = Case(name, phase)
    try:
        place = site.place()
        before = set(logs(place.folder))
        reach(place.lab, phase)
        steps = _steps(place.lab)
    except QuadlabError as error:
        case.why = f"not flown as far as the fault: {error}"
        return case
    case.began = began = time.monotonic()
    with fault(name, place):
        while time.monotonic() < began + FROZEN:  # an answer from before it says nothing
            _bring_down(place.lab, case, began + FROZEN)
            time.sleep(LOOK)
        if "frozen" not in name:
            _bring_down(place.lab, case, began + WITHIN)
    _bring_down(place.lab, case, began + 1.5 * WITHIN, is_over=True)
    case.took = time.monotonic() - began
    new = [path for path in logs(place.folder) if path not in before]
    _read(case, new)
    _judge(case, place.lab, steps)
    if keep is not None and case.why:
        for path in new:
            run = path.parent.name if path.name == "station.mcap" else ""
            copy = keep / f"{name} {phase}".replace(" ", "_").replace("/", "") / f"{run}{path.name}"
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
    return case


def _bring_down(lab: Laboratory, case: Case, end: float, is_over: bool = False) -> None:
    """Land as a person at the page would, until the vehicle is down, or ready if it is over."""
    while time.monotonic() < end and lab.up.poll() is None:
        summary = lab.summary()
        status = summary.get("status") or {}
        is_fresh = bool(status) and (summary["age"].get("status") or 99.0) < 2.0
        case.down = is_fresh and not status["armed"]
        case.ready = case.down and bool((summary.get("preflight") or {}).get("ready"))
        case.said = _reasons(summary)
        press = summary.get("emergency") or {}
        is_new = press.get("age", math.inf) < time.monotonic() - case.began
        if case.phase == EMERGENCY and is_new and press["phase"] == "acknowledged":
            case.answered = press["after"]
        if case.ready or (case.down and not is_over):
            return
        if is_fresh and status["armed"] and status["mode"] == "armed":
            if not status["airborne"]:
                lab.does("disarm")
            elif case.phase == EMERGENCY:
                lab.does("emergency", action="land")
            elif status["behavior"] != "land":
                lab.starts("land")
        time.sleep(LOOK)


def _reasons(summary: dict[str, Any]) -> str:
    checks = (summary.get("preflight") or {}).get("checks") or []
    return "; ".join(
        f"{c['name']}: {c['found']}" for c in checks if c["state"] not in ("ok", "off")
    )


def _steps(lab: Laboratory) -> int:
    """Return the number of events about a clock that was set."""
    return sum("clock" in event["text"] and "set" in event["text"] for event in lab.get(EVENTS))


def _judge(case: Case, lab: Laboratory, steps: int) -> None:
    """Say what was wrong; `steps`: see `_steps`, before the fault."""
    if lab.up.poll() is not None:  # all is over: on the ground only if something says so
        case.said = lab.last_lines()
        if case.phase not in ("on the ground", "armed") and math.isnan(case.impact):
            case.why = "" if case.fault.startswith("up ") else "ended in the air"
        if not case.said:
            case.why = "ended without a word"
    elif not case.down:
        case.why = f"not on the ground: {lab.status().get('behavior', 'not heard')}"
    elif not case.ready and not case.said:
        case.why = "neither ready nor a reason"
    elif "clock" in case.fault and _steps(lab) == steps:
        case.why = "no event tells of the step"
    if case.impact > SOFT:
        case.why = f"hard: {case.impact:.2f} m/s"
    if case.unreadable:
        case.why = f"{case.why} log: {case.unreadable[0]}".strip()


def _read(case: Case, paths: Sequence[Path]) -> None:
    """Read the logs of a case for its touch-down, by the truth if that was recorded."""
    impacts: dict[str, float] = {}
    for path in paths:
        try:
            for name in ("truth", "state"):
                impact = touch_down(path, name)
                if not math.isnan(impact):
                    impacts[name] = max(impact, impacts.get(name, 0.0))
        except QuadlabError as error:
            if path.exists():  # a log that holds nothing is removed by its repair
                case.unreadable.append(f"{path.name}: {error}")
    case.impact = impacts.get("truth", impacts.get("state", math.nan))


def cases(only: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Yield each fault and phase; every fault comes in one phase first, then in the next."""
    names = [name for name in FAULTS if not only or any(word in name for word in only)]
    for turn in range(len(PHASES)):
        for k, name in enumerate(names):
            yield name, PHASES[(turn + k) % len(PHASES)]


def fly_all(
    chosen: Sequence[tuple[str, str]],
    minutes: float = math.inf,
    file: Path | None = None,
    keep: Path | None = None,
) -> tuple[list[Case], list[str]]:
    """Fly cases; return them with the processes that outlived their laboratory."""
    found, end = _flown(file), time.monotonic() + 60.0 * minutes
    done = {(case.fault, case.phase) for case in found}
    with tempfile.TemporaryDirectory(prefix="quadlab-faults-") as folder:
        site = Site(Path(folder))
        try:
            for name, phase in (one for one in chosen if one not in done):
                if time.monotonic() > end:
                    break
                found.append(fly(site, name, phase, keep))
                print(found[-1], file=sys.stderr, flush=True)
                if not (found[-1].is_good and found[-1].ready):
                    site.close()
                if file is not None:
                    file.write_text(json.dumps([asdict(one) for one in found], indent=1) + "\n")
        finally:
            site.close()
    return found, site.orphans


def _flown(file: Path | None) -> list[Case]:
    """Return the cases of a file that an earlier run wrote; none if there is no file yet."""
    if file is None or not file.exists():
        return []
    return [Case(**one) for one in json.loads(file.read_text())]


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    chosen = list(cases())
    return report(*fly_all(chosen[: size.of(len(chosen), len(FAULTS), 2)]))


def report(found: Sequence[Case], left: Sequence[str]) -> Report:
    """Return one row for each fault."""
    made = Report(
        "laboratory_faults",
        "Laboratories whose processes die or starve",
        [f"{len(found)} cases; a person lands; soft: at most {SOFT} m/s"],
    )
    for name in dict.fromkeys(case.fault for case in found):
        of = [case for case in found if case.fault == name]
        impacts = [case.impact for case in of if not math.isnan(case.impact)]
        answers = [case.answered for case in of if not math.isnan(case.answered)]
        made.rows.append(
            Row(
                name,
                {
                    "good": f"{sum(case.is_good for case in of)} of {len(of)}",
                    "ready again": f"{sum(case.ready for case in of)}",
                    **({"hardest, m/s": max(impacts)} if impacts else {}),
                    **({"acknowledged, s": max(answers)} if answers else {}),
                    "longest, s": max(case.took for case in of),
                },
            )
        )
    made.notes = [f"{c.fault}, {c.phase}: {c.why} ({c.said})" for c in found if c.why]
    made.notes += [f"left behind: {words}" for words in left]
    made.targets = [
        Target("cases that are not good", sum(not case.is_good for case in found), 0),
        Target("processes left behind", len(left), 0),
    ]
    return made


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=math.inf)
    parser.add_argument("--only", default="", help="words in the names of faults")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends its laboratory
    only = [word for word in options.only.split(",") if word]
    found = report(*fly_all(list(cases(only)), options.minutes, options.json, options.keep))
    print(found.as_markdown())
    return 0 if all(target.met for target in found.targets) else 1


if __name__ == "__main__":
    sys.exit(main())
