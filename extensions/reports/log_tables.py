"""The tables of a log's content: parameters, time line, recording, versions."""

from __future__ import annotations

from collections.abc import Mapping

from console.reports.content import Block, Heading, Table, Text
from console.reports.judgement import Judgement
from console.reports.run_log import ON_CHANGE, RunLog
from console.reports.writer import Defaults
from extensions.reports.tables import NOT_RECORDED, shown
from flight_log.attached import json_value

MOST_GAPS = 60


def parameter_blocks(log: RunLog, judged: Judgement, defaults: Defaults) -> list[Block]:
    """Return the parameters that differ from their defaults first, then all, folded."""
    blocks: list[Block] = [Heading("Parameters")]
    values = log.parameters
    if judged.options:
        chosen = [(name, shown(value)) for name, value in judged.options.items()]
        blocks.append(Table("Options of the experiment", ("option", "value"), chosen, "50l 50r"))
    values = {k: v for k, v in values.items() if not k.startswith("experiment.")}
    if not values:
        return [*blocks, Text(f"{NOT_RECORDED.capitalize()} in this log.")]
    attached = log.json_attachment("defaults.json")
    if isinstance(attached, Mapping):
        whose = "the defaults in the log"
    else:
        whose = "the defaults of the version that wrote this report"
        attached = defaults()
    known = {name: value for name, value in values.items() if name in attached}
    differing = {
        name: value
        for name, value in known.items()
        if value != attached[name] and not name.endswith(".seed")
    }
    if not known:
        blocks.append(Text("The defaults are not known, so all parameters are listed."))
    elif differing:
        rows = [(n, shown(v), shown(attached[n])) for n, v in sorted(differing.items())]
        head = ("parameter", "value", "default")
        blocks.append(Table(f"Differing from {whose}", head, rows, "52l 24r 24r"))
        left = len(values) - len(known)
        if left:
            blocks.append(Text(f"The defaults of {left} more are not known; all are listed below."))
    else:
        blocks.append(Text(f"None of the {len(known)} comparable parameters differs from {whose}."))
    rows = [
        (name, shown(value), shown(log.changes[name]) if name in log.changes else "")
        for name, value in sorted(values.items())
    ]
    head = ("parameter", "at the start", "at the end, if changed")
    blocks.append(Table(f"All {len(rows)} parameters", head, rows, "52l 24r 24r", folded=True))
    return blocks


def timeline_blocks(log: RunLog) -> list[Block]:
    """Return events, warnings, marks, parameter changes and behaviors in time order."""
    rows = [
        (
            f"{line.time:.2f}",
            "WARNING" if line.kind == "warning" else line.kind,
            line.text,
            line.who,
        )
        for line in log.lines
    ]
    blocks: list[Block] = [Heading("Timeline")]
    behaviors = [
        (f"{start:.1f}", f"{end:.1f}", name.replace("_", " "))
        for start, end, name in log.spans("status", "behavior")
    ]
    if behaviors:
        spans = ("from, s", "to, s", "behavior")
        is_long = len(behaviors) > 20
        blocks.append(Table("Behaviors", spans, behaviors, "14r 14r 72l", is_long))
    if not rows:
        return [*blocks, Text("This log has no events, marks or changes of parameters.")]
    title = f"Events, marks and changes of parameters ({len(rows)})"
    head = ("s", "what", "text", "by")
    blocks.append(Table(title, head, rows, "9r 13l 62l 16l", len(rows) > 60))
    return blocks


def recording_blocks(log: RunLog) -> list[Block]:
    """Return the topics with their rates and gaps, and the missing parts of the file."""
    rows, gaps = [], []
    for name, series in sorted(log.topics.items()):
        span = float(series.time[-1] - series.time[0])
        count, silent = len(series.time), [] if name in ON_CHANGE else series.gaps
        rate = f"{(count - 1) / span:.1f}" if span > 0.0 and name not in ON_CHANGE else ""
        longest = f"{max(length for _, length in silent):.2f}" if silent else ""
        rows.append((name, str(count), rate, str(len(silent) or ""), longest))
        gaps += [(f"{start:.2f}", f"{length:.2f}", name) for start, length in silent]
    head = ("topic", "messages", "Hz", "gaps", "longest, s")
    blocks: list[Block] = [Heading("Recording"), Table("Topics", head, rows, "40l 15r 15r 15r 15r")]
    if gaps:
        gaps.sort(key=lambda row: float(row[0]))
        more = f", the first {MOST_GAPS}" if len(gaps) > MOST_GAPS else ""
        title = f"Gaps longer than 4 usual periods and 50 ms ({len(gaps)}{more})"
        shown_gaps = gaps[:MOST_GAPS]
        blocks.append(Table(title, ("at, s", "for, s", "topic"), shown_gaps, "14r 14r 72l", True))
    if link := _link_words(log):
        blocks.append(Text(link))
    return blocks


def version_blocks(log: RunLog) -> list[Block]:
    """Return the versions of the software that recorded the log."""
    run = log.run
    if not run:
        return [Heading("Versions"), Text(f"{NOT_RECORDED.capitalize()}: no metadata in this log.")]
    rows = []
    if "git_revision" in run:
        changed = {"true": ", with uncommitted changes", "unknown": ", perhaps changed since"}
        rows.append(
            ("quadlab", f"{run['git_revision']}{changed.get(run.get('git_dirty', ''), '')}")
        )
    try:
        versions = json_value(run.get("versions", "{}"))
        rows += [(str(name), str(value)) for name, value in dict(versions).items()]
    except (ValueError, TypeError):
        rows.append(("versions", run["versions"]))
    shown_above = {"git_revision", "git_dirty", "versions", "run_id", "vehicle", "experiment"}
    rows += [(name, value) for name, value in run.items() if name not in shown_above]
    return [Heading("Versions"), Table("", ("what", "which"), rows, "25l 75l")]


def _link_words(log: RunLog) -> str:
    lines = []
    if log.has("link_status"):
        link = log.topics["link_status"].rows(("loss", "outages", "outage_total"))
        if len(link):
            lines.append(
                f"Lost telemetry in the worst second: {100 * link[:, 0].max():.1f} %; "
                f"outages of the link: {link[-1, 1]:.0f}, {link[-1, 2]:.1f} s in total."
            )
    if log.has("status"):
        names = ("missed_frames", "damaged_frames", "overruns")
        counts = log.topics["status"].rows(names)
        if len(counts):
            words = ("missing samples", "damaged frames", "ticks longer than a period")
            found = (f"{n:.0f} {word}" for n, word in zip(counts[-1], words, strict=True))
            lines.append(f"The vehicle counted {', '.join(found)}.")
    return " ".join(lines)
