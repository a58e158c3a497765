"""Rows of the list of runs, with what is stored outside of the catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.catalogue.completeness import as_json, completeness_of
from console.catalogue.marks import mark_counts
from console.catalogue.notes import Note, newest_notes
from console.catalogue.tables import RunEntry
from console.catalogue.tags import tags_of
from console.catalogue.titles import Title, titles_of
from console.runs.title import NAMES
from flight_log.file import is_being_written
from quadrotor.json_object import JsonObject
from web.runs.judged import judged


def lines(catalogue: Catalogue, entries: Sequence[RunEntry]) -> list[JsonObject]:
    """Return for each run its entry, title, tags, number of marks, author of the notes, verdict and
    rms of the position error.

    `completeness` is how it compares with the vehicle's own log (null if it was not compared).
    """
    ids = [entry.id for entry in entries]
    tags, notes = tags_of(catalogue, ids), newest_notes(catalogue, ids)
    marks = mark_counts(catalogue, ids)
    completeness, titles = completeness_of(catalogue, ids), titles_of(catalogue, ids)
    return [
        {
            **asdict(entry),
            "tags": tags.get(entry.id, []),
            "marks": marks.get(entry.id, 0),
            "notes_by": about(notes.get(entry.id)),
            **_titled(titles.get(entry.id), _report(catalogue.folder / Path(entry.file).name)),
            "completeness": as_json(completeness.get(entry.id)),
            "recording": not entry.complete and _is_recorded(catalogue, entry),
        }
        for entry in entries
    ]


def about(note: Note | None) -> JsonObject:
    """Return who wrote the notes and when (s, epoch); version 0: no notes yet."""
    if note is None:
        return {"version": 0, "author": "", "stamp": None}
    stamp = note.stamp_ns * 1e-9 if note.stamp_ns else None
    return {"version": note.version, "author": note.author, "stamp": stamp}


def _titled(title: Title | None, report: JsonObject) -> JsonObject:
    """Return the report's fields with the title; without a hand-written one, that of an experiment
    begins with its name, once.
    """
    text, author = (title.text, title.author) if title else ("", "")
    name = str(report["experiment"])
    experiment = NAMES.get(name, name.replace("_", " ")).capitalize()
    if experiment and not author and not text.startswith(experiment):
        text = f"{experiment}, {text[:1].lower()}{text[1:]}" if text else experiment
    return {"title": text, "title_by": author, **report}


def _is_recorded(catalogue: Catalogue, entry: RunEntry) -> bool:
    try:
        return is_being_written(catalogue.folder / Path(entry.file).name)
    except OSError:
        return False


def _report(log: Path) -> JsonObject:
    """Return the report's fields; `verdict` is "unreadable" if it cannot be read."""
    of = judged(log)
    if of is None:
        return {"report": False, "experiment": "", "verdict": "", "rms": None}
    return {"report": True, "experiment": of.experiment, "verdict": of.verdict, "rms": of.rms}
