"""`quadlab log info LOG`, `quadlab log check LOG` and `quadlab log recover LOG`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from quadlab.log_commands.log_file import LogFile, check_log_file, progress_of
from quadlab.option_types import Flag
from quadrotor.errors import LogFormatError

if TYPE_CHECKING:
    from console.evaluation.findings import Finding
    from flight_log.summary import LogSummary


@dataclass
class Info:
    """Print the contents of a log: topics, counts, rates, and what it was recorded with."""

    file: LogFile
    """the MCAP file"""
    json: Flag = False
    """print one line of JSON"""
    explain: Flag = False
    """also print what happened in the flight, the most important first"""

    def run(self) -> int:
        from flight_log.summary import summarize

        check_log_file(self.file)
        with progress_of(f"reading {self.file.name}") as progress:
            found = summarize(self.file, progress)
        findings: list[Finding] = []
        if self.explain:
            from console.evaluation.findings import explain_log

            findings = explain_log(self.file)
        if self.json:
            described = _described(found)
            if self.explain:
                described["findings"] = [one.as_json() for one in findings]
            print(json.dumps(described))
            return 0
        print(
            f"{self.file}: {found.message_count} messages in {found.duration:.1f} s, "
            f"{found.bytes / 1e6:.1f} MB{', torn and repaired' if found.recovered else ''}"
        )
        for line in ticks_line(self.file, found.filled):
            print(f"  {line}")
        if found.tear:
            print(f"  it is torn: it {found.tear}; repair it with: quadlab log recover {self.file}")
        for topic, one in sorted(found.topics.items()):
            rate = one.count / found.duration if found.duration > 0 else 0.0
            print(f"  {topic:32} {one.count:8} {rate:8.1f} Hz  {one.type_name}")
        for name, text in sorted(found.run.items()):
            print(f"  {name}: {text}")
        for name, size in sorted(found.attachments.items()):
            print(f"  attached: {name}, {size} bytes")
        if self.explain:
            claims = [f"{one.start:.1f} s: {one.text}{_share(one)}" for one in findings]
            print(
                "what happened:",
                *claims or ["No anomalies found in what was recorded."],
                sep="\n  ",
            )
        return 0


def _share(finding: Finding) -> str:
    """Return the confidence of a cause among several; nothing for the only one."""
    share = finding.confidence
    return f" ({100 * share:.0f} % of the evidence)" if 0.0 < share < 0.995 else ""


def _described(found: LogSummary) -> dict[str, object]:
    """Return the summary for JSON; times in s and ns, rates in Hz."""
    topics = {
        name: {
            "type": one.type_name,
            "messages": one.count,
            "rate": one.count / found.duration if found.duration > 0 else 0.0,
        }
        for name, one in sorted(found.topics.items())
    }
    return {
        "file": str(found.path),
        "bytes": found.bytes,
        "messages": found.message_count,
        "start_ns": found.start_ns,
        "duration": found.duration,
        "closed": found.closed,
        "recovered": found.recovered,
        "tear": found.tear,
        "topics": topics,
        "run": found.run,
        "filled": found.filled,
        "attachments": found.attachments,
    }


def ticks_line(path: Path, filled: Mapping[str, str]) -> list[str]:
    """Return the comparison of a run with the vehicle's own log, if known: from the run's
    catalogue, else from its own metadata.
    """
    from console.catalogue.catalogue import DATABASE, Catalogue
    from console.catalogue.completeness import completeness_of
    from flight_log.run_folder import RUNS

    data = path.resolve().parent.parent
    if path.resolve().parent.name == RUNS and (data / DATABASE).is_file():
        catalogue = Catalogue(data)
        try:
            if found := completeness_of(catalogue, [path.stem]).get(path.stem):
                return [f"ticks: {found.line}"]
        finally:
            catalogue.close()
    if not filled:
        return []
    seconds, missing = float(filled.get("seconds", 0)), float(filled.get("missing_seconds", 0))
    lacks = (
        f"; {missing:.1f} s missing: {filled.get('missing')}" if missing else "; nothing is missing"
    )
    return [f"ticks: {seconds:.1f} s were restored from the vehicle's log{lacks}"]


@dataclass
class Check:
    """Check that a log is complete, that it can be read, and that nothing is missing in between."""

    file: LogFile
    """the MCAP file"""

    def run(self) -> int:
        from flight_log.check import check_log

        check_log_file(self.file)
        with progress_of(f"checking {self.file.name}") as progress:
            found = check_log(self.file, progress)
        for line in found.notes:
            print(f"note: {line}")
        for line in found.problems:
            print(f"not sound: {line}")
        if not found.problems:
            print(f"sound: {found.count} messages of {len(found.topics)} topics, read to the end")
        return 1 if found.problems else 0


@dataclass
class Recover:
    """Repair, in place, the log of a writer that was killed; a complete one is left alone. Damage
    that cannot be repaired is reported, with exit status 1."""

    file: LogFile
    """the MCAP file"""

    def run(self) -> int:
        from flight_log.recovery import recover

        check_log_file(self.file)
        found = recover(self.file)
        if not found.torn:
            return self._left_alone()
        print(
            f"{self.file} was torn ({found.reason}) and was repaired in place: "
            f"{found.messages} messages kept, {found.lost_bytes} bytes after the tear "
            f"and {found.damaged_chunks} damaged chunks lost"
        )
        if found.kept is not None:
            print(f"the original is kept as {found.kept}, as more data follow the tear")
        return 0

    def _left_alone(self) -> int:
        from flight_log.check import damage

        try:
            lines = damage(self.file)
        except LogFormatError:  # its compression is not supported; its index is sound
            lines = []
        for line in lines:
            print(f"damaged, and cannot be repaired: {line}")
        if lines:
            print(
                f"{self.file} has its index, and nothing was changed; the rest of it can be read, "
                "checked and exported as it is"
            )
            return 1
        print(f"{self.file} is complete; nothing was changed")
        return 0
