"""Page of runs, their list, notes, tags, marks and files.

An unknown run is a StorageError, answered with 404.
"""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

from fastapi import FastAPI, HTTPException, Query
from fastapi.responses import FileResponse

from console.catalogue.marks import marks_of
from console.catalogue.notes import notes_history, write_notes
from console.catalogue.search import RunSearch
from console.catalogue.tags import all_tags, change_tags
from console.catalogue.titles import write_title
from quadrotor.errors import StorageError
from quadrotor.json_object import JsonObject
from web.access.requester import Operator
from web.feature import Feature
from web.runs.again import add_again
from web.runs.bodies import MarkBody, NotesBody, TagsBody, TitleBody
from web.runs.listing import about, lines
from web.runs.onboard import add_onboard
from web.runs.sharing import add_sharing, log_response
from web.runs.trash import add_trash

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

MOST = 1000

Text = Annotated[str, Query(max_length=300)]
Nanoseconds = Annotated[int, Query(ge=0, lt=2**63)]


def new_feature() -> Feature:
    return Feature(add_runs)


def add_runs(app: FastAPI, parts: VehicleContext) -> None:
    """Add /runs and the routes below /api/runs.

    Also those below /api/tags, /api/marks, /api/trash, /api/storage and /api/onboard.
    """
    _add_list(app, parts)
    _add_notes(app, parts)
    _add_tags_and_marks(app, parts)
    add_again(app, parts)
    add_trash(app, parts)
    add_sharing(app, parts)
    add_onboard(app, parts)


def _add_list(app: FastAPI, parts: VehicleContext) -> None:
    catalogue = parts.catalogue

    @app.get("/api/runs")
    def runs(search: Text = "", limit: int = 200, offset: int = 0) -> list[JsonObject]:
        """Return the runs, newest first.

        Each word of `search` must be in the id, title, operator, notes, vehicle, a tag or the text
        of a mark. `report`: whether it has one.
        """
        return lines(
            catalogue, catalogue.runs(search, limit=min(max(limit, 1), MOST), offset=max(offset, 0))
        )

    @app.get("/api/runs/search")
    def search(
        words: Text = "",
        tag: Text = "",
        vehicle: Text = "",
        since_ns: Nanoseconds = 0,
        until_ns: Nanoseconds = 0,
        limit: Annotated[int, Query(ge=1, le=MOST)] = 100,
        offset: Annotated[int, Query(ge=0)] = 0,
    ) -> JsonObject:
        """Return a part of the list, and the total; `since_ns` and `until_ns` are of the epoch."""
        wanted = RunSearch(words, tag, vehicle, since_ns, until_ns)
        found = catalogue.runs(wanted, limit=limit, offset=offset)
        return {"total": catalogue.count(wanted), "runs": lines(catalogue, found)}

    @app.head("/api/runs/{run_id}/download", include_in_schema=False)
    @app.get("/api/runs/{run_id}/download")
    def download(run_id: str) -> FileResponse:
        """Return the run as one MCAP file; ranges work, so a broken download can be resumed."""
        return log_response(catalogue.resolve(run_id))


def _add_notes(app: FastAPI, parts: VehicleContext) -> None:
    catalogue = parts.catalogue

    @app.put("/api/runs/{run_id}/notes")
    def set_notes(run_id: str, body: NotesBody, session: Operator) -> JsonObject:
        """Set the notes. The last writer wins, and earlier texts stay in the history.

        `replaced` is another person's text that was written after the version `seen`.
        """
        written = write_notes(catalogue, run_id, body.notes, session.label, body.seen)
        parts.hub.runs_changed([run_id])
        replaced = written.replaced
        return {
            "notes": written.note.text,
            "notes_by": about(written.note),
            "replaced": {"notes": replaced.text, **about(replaced)} if replaced else None,
        }

    @app.put("/api/runs/{run_id}/title")
    def set_title(run_id: str, body: TitleBody, session: Operator) -> JsonObject:
        """Set the title; an empty one brings the automatic title back. Return the title in force
        as the list of runs does.
        """
        write_title(catalogue, run_id, body.title, session.label)
        parts.hub.runs_changed([run_id])
        [line] = lines(catalogue, [catalogue.get(run_id)])
        return {name: line[name] for name in ("title", "title_by")}

    @app.get("/api/runs/{run_id}/notes")
    def history(run_id: str) -> list[JsonObject]:
        """Return all texts of the notes, newest first."""
        return [{"notes": n.text, **about(n)} for n in notes_history(catalogue, run_id)]


def _add_tags_and_marks(app: FastAPI, parts: VehicleContext) -> None:
    catalogue = parts.catalogue

    @app.get("/api/tags")
    def tags() -> list[JsonObject]:
        """Return all tags, the most used first."""
        return [{"tag": tag, "runs": count} for tag, count in all_tags(catalogue).items()]

    @app.post("/api/tags")
    def change(body: TagsBody, _: Operator) -> dict[str, list[str]]:
        """Add and remove tags of several runs, all or nothing; return run → tags afterwards."""
        try:
            for run_id in body.runs:
                catalogue.get(run_id)
        except StorageError as error:
            raise HTTPException(404, str(error)) from error
        changed = change_tags(catalogue, body.runs, body.add, body.remove)
        parts.hub.runs_changed(changed)
        return changed

    @app.get("/api/runs/{run_id}/marks")
    def marks(run_id: str) -> list[JsonObject]:
        """Return the marks in the order of time; `time` is in s since the start of the run."""
        return [asdict(mark) for mark in marks_of(catalogue, run_id)]

    @app.post("/api/marks")
    async def mark(body: MarkBody, session: Operator) -> JsonObject:
        """Mark the moment when the key was pressed in the run being recorded; needs no lease.

        With a known id, only the text is changed.
        """
        pressed_ns = 0 if body.ago is None else time.time_ns() - round(body.ago * 1e9)
        answer = await parts.station.command(
            "mark", session.label, id=body.id, text=body.text, pressed_ns=pressed_ns
        )
        return {
            "id": body.id,
            "run_id": answer.run_id,
            "time": float(answer.time),
            "logged": bool(answer.logged),
        }
