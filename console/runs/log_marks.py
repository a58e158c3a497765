"""Event marks read from a log, for a catalogue that does not have them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.catalogue.marks import Mark, find_mark, keep_mark
from flight_log.reader import read_topic
from vehicle_link.messages import decode, stamp_of
from vehicle_link.topics import TOPICS


def marks_in_log(log: Path, run_id: str) -> list[Mark]:
    """Return the marks of a closed file, each with its newest text.

    Raises LogFormatError or StorageError.
    """
    found: dict[str, Mark] = {}
    for payload in read_topic(log, "marks"):
        sent = decode(payload, TOPICS["marks"].type_name)
        before = found.get(sent.id)
        mark = Mark(
            run_id=run_id,
            id=sent.id,
            stamp_ns=stamp_of(sent),
            time=sent.time,
            text=sent.text,
            requester=sent.requester,
        )
        found[sent.id] = replace(before, text=mark.text) if before else mark
    return list(found.values())


def keep_marks_of_log(catalogue: Catalogue, log: Path, run_id: str) -> None:
    """Store the marks of a run that the catalogue did not have. Raises StorageError or
    LogFormatError.
    """
    for mark in marks_in_log(log, run_id):
        if find_mark(catalogue, mark.id) is None:
            keep_mark(catalogue, mark)
