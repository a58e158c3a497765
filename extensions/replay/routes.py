"""Page `/replay/{run_id}`, and the routes for its content.

All of them only read: viewers may replay. Runs are found in the catalogue; the vehicle's own logs,
which are in no catalogue, as `onboard:NAME` (of the one simulated here), `onboard:VEHICLE:NAME`
(fetched from a vehicle) and `onboard:VEHICLE:here:NAME` (of several simulated here).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, Query
from fastapi.responses import Response

from console.catalogue.catalogue import SUFFIX, Catalogue
from extensions.replay.store import Building, ReplayStore
from flight_log.file import is_being_written
from quadrotor.errors import StorageError
from web.feature import Feature
from web.live.pictures import Camera

ONBOARD = "onboard"
MOST_SIGNALS = 64
MOST_POINTS = 200_000
BINARY = "application/octet-stream"

Names = Annotated[list[str], Query(alias="signal", max_length=MOST_SIGNALS)]
Texts = Annotated[list[str], Query(max_length=MOST_SIGNALS)]
Seconds = Annotated[float, Query(ge=-1e7, le=1e7, allow_inf_nan=False)]


class _Logs:
    """The logs that can be replayed: the catalogue's runs, and the vehicle's own logs."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue, self._data = catalogue, catalogue.folder.parent

    def onboard(self) -> dict[str, Path]:
        """Return the onboard logs by id."""
        found: dict[str, Path] = {}
        for pattern, wheres in (
            ("onboard", "onboard"),
            ("onboard/*", "onboard:{name}"),
            ("vehicles/*/onboard", "onboard:{parent}:here"),
        ):
            for folder in self._data.glob(pattern):
                where = wheres.format(name=folder.name, parent=folder.parent.name)
                found |= {f"{where}:{path.stem}": path for path in folder.glob(f"*{SUFFIX}")}
        return found

    def find(self, run_id: str) -> Path:
        """Return the log of a run. Raises StorageError."""
        kind, _, name = run_id.partition(":")
        if kind != ONBOARD or not name:
            return self._catalogue.resolve(run_id)
        path = self.onboard().get(run_id)  # never a path made from the request
        if path is not None and path.is_file():
            return path
        raise StorageError(f"no log {name!r:.80} in the folder {ONBOARD}")


def add_replay(app: FastAPI, catalogue: Catalogue, store: ReplayStore) -> None:
    """Add the routes. An unknown run is a StorageError, answered with 404."""
    logs = _Logs(catalogue)
    _add_lists(app, logs, store)
    _add_samples(app, logs, store)
    _add_judgements(app, logs, store)


def _add_lists(app: FastAPI, logs: _Logs, store: ReplayStore) -> None:
    @app.get("/api/replay")
    def onboard() -> list[dict[str, Any]]:
        """Return the vehicle's own logs on this computer, newest first; runs are in /api/runs."""
        found = [(path.stat().st_mtime, name, path) for name, path in logs.onboard().items()]
        return [
            {"id": name, "bytes": path.stat().st_size}
            for _, name, path in sorted(found, reverse=True)[:200]
        ]

    @app.get("/api/replay/{run_id}")
    def describe(run_id: str, newer: bool = False) -> dict[str, Any]:
        """Return signals, events, spans and parameters of a run, or its progress: ask again."""
        log = logs.find(run_id)
        found = store.get(log, newer=newer)
        if isinstance(found, Building):
            return {"state": "building", "progress": found.progress}
        return {
            "state": "ready",
            "id": run_id,
            "is_growing": is_being_written(log),
            "is_current": store.is_current(log),
            **found.described(),
        }


def _add_samples(app: FastAPI, logs: _Logs, store: ReplayStore) -> None:
    @app.get("/api/replay/{run_id}/track")
    def track(run_id: str) -> Response:
        """Return rows of float32 for the 3D view, see extensions/replay/track.py."""
        return Response(bytes(store.opened(logs.find(run_id)).track), media_type=BINARY)

    @app.get("/api/replay/{run_id}/window")
    def window(
        run_id: str,
        start: Seconds,
        end: Seconds,
        signal: Names,
        points: Annotated[int, Query(ge=2, le=MOST_POINTS)] = 1000,
        extremes: bool = True,
    ) -> Response:
        """Return signals between two instants (s) for a chart, see extensions/replay/reader.py."""
        found = store.opened(logs.find(run_id)).window(signal, start, end, points, extremes)
        return Response(found, media_type=BINARY)

    @app.get("/api/replay/{run_id}/picture", response_class=Response)
    def picture(run_id: str, camera: Camera, t: Seconds) -> Response:
        """Return a camera's newest picture at t (s), a JPEG.

        The header `x-time` is the time (s) of its capture. The answer is empty (204) before the
        first one.
        """
        found = store.opened(logs.find(run_id)).picture(f"{camera}_picture", t)
        if found is None:
            return Response(status_code=204)
        taken, jpeg = found
        return Response(jpeg, media_type="image/jpeg", headers={"x-time": f"{taken:.4f}"})

    @app.get("/api/replay/{run_id}/at")
    def at(run_id: str, t: Seconds, signal: Names) -> dict[str, list[float | None]]:
        """Return the newest value and its age (s) of each signal at t (s)."""
        return store.opened(logs.find(run_id)).at(signal, t)


def _add_judgements(app: FastAPI, logs: _Logs, store: ReplayStore) -> None:
    @app.get("/api/replay/{run_id}/statistics")
    def statistics(
        run_id: str, start: Seconds, end: Seconds, signal: Names
    ) -> dict[str, dict[str, float | None]]:
        """Return count, mean, rms, min and max of all samples between two instants (s)."""
        return store.opened(logs.find(run_id)).statistics(signal, start, end)

    @app.get("/api/replay/{run_id}/expressions")
    def expressions(run_id: str, text: Texts) -> list[dict[str, Any]]:
        """Return the derived signal of each text, or what is wrong with it as `problem`."""
        return store.opened(logs.find(run_id)).expressions(text)

    @app.get("/api/replay/{run_id}/spectrum")
    def spectrum(run_id: str, start: Seconds, end: Seconds, signal: Names) -> dict[str, Any]:
        """Return spectra of signals between two instants (s), and the rotors' frequencies."""
        return store.opened(logs.find(run_id)).spectra(signal, start, end)

    @app.get("/api/replay/{run_id}/spectrogram")
    def spectrogram(run_id: str, start: Seconds, end: Seconds, signal: str) -> dict[str, Any]:
        """Return a signal's density over time and frequency, and the rotors' frequencies."""
        return store.opened(logs.find(run_id)).spectrogram(signal, start, end)


_STORE = ReplayStore()
FEATURE = Feature(lambda app, context: add_replay(app, context.catalogue, _STORE))
