"""A set of beacons: their ids, their positions, the plane nearest to them, and the positions of a
frame's beacons.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import BEARINGS_SAMPLE, MAX_BEACONS, Array, Record, beacon_ids_of

LEAST = 4
"""Least number of beacons of a set: a pose from one frame needs as many in view."""
ID_MAX = 2**31 - 1
FARTHEST = 1000.0
"""Largest distance in m from the world's origin on each axis; more means a wrong unit."""
IN_LINE = 1e-3
"""Share of the extent below which a set counts as lying on one line."""


@dataclass(frozen=True, init=False, eq=False, repr=False, slots=True)
class Beacons:
    """N beacons with known identity and position; immutable, equal by value.

    Args:
        ids: (N,), integers 0 … 2³¹ − 1, each once; 4 <= N <= MAX_BEACONS; lists are accepted.
        positions_w: (N, 3) m, world axes; not on one line; lists are accepted. An estimator that
            needs them in one plane refuses others (`estimation.poses.beacon_plane`).

    Attributes:
        ids, positions_w: int32 and float64, copies, read-only as all arrays here.
        center_w: (3,) m, their mean.
        normal_w: (3,) unit normal of the nearest plane, with its largest component positive.

    Raises MeasurementError when malformed; DegenerateGeometryError when they are too few or on
    one line.
    """

    ids: npt.NDArray[np.int32]
    positions_w: Array
    center_w: Array
    normal_w: Array

    def __init__(self, ids: npt.ArrayLike, positions_w: npt.ArrayLike) -> None:
        of_all = _checked_ids(ids)
        places = _checked_positions(positions_w, of_all)
        arrays: tuple[npt.NDArray[np.generic], ...] = (of_all, places, *_plane(places))
        for name, array in zip(("ids", "positions_w", "center_w", "normal_w"), arrays, strict=True):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def moved(self, id: int, position_w: npt.ArrayLike) -> Beacons:
        """Return the set with one beacon moved to (3,) m. Raises as the constructor does."""
        places = self.positions_w.copy()
        try:
            places[self._index(id)] = np.asarray(position_w, dtype=float).reshape(3)
        except (TypeError, ValueError) as error:
            raise MeasurementError(
                f"beacon {id} cannot be moved to {position_w!r}; allowed are three numbers, m"
            ) from error
        return Beacons(self.ids, places)

    def place(self, id: int) -> tuple[float, float, float]:
        """Return a beacon's position, m, world axes. Raises MeasurementError for an unknown id."""
        x, y, z = self.positions_w[self._index(id)].tolist()
        return x, y, z

    def __len__(self) -> int:
        return len(self.ids)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Beacons):
            return NotImplemented
        return np.array_equal(self.ids, other.ids) and np.array_equal(
            self.positions_w, other.positions_w
        )

    def __hash__(self) -> int:
        return hash((*self.ids.tolist(), *self.positions_w.ravel().tolist()))

    def __repr__(self) -> str:
        return f"Beacons({self.ids.tolist()}, {self.positions_w.tolist()})"

    def _index(self, id: int) -> int:
        [found] = np.nonzero(self.ids == id)
        if len(found) == 0:
            raise MeasurementError(f"no beacon {id}; there are {self.ids.tolist()}")
        return int(found[0])


def _checked_ids(ids: npt.ArrayLike) -> npt.NDArray[np.int32]:
    try:
        given = np.asarray(ids)
        whole = given.astype(np.int64)
        sound = given.ndim == 1 and given.dtype != bool and np.array_equal(whole, given)
    except (TypeError, ValueError, OverflowError):
        sound = False
    if not sound:
        raise MeasurementError(f"beacon ids must be a sequence of integers, not {ids!r}")
    if len(whole) < LEAST:
        raise DegenerateGeometryError(
            f"{len(whole)} beacons; allowed are {LEAST} to {MAX_BEACONS}: add {LEAST - len(whole)}"
        )
    if len(whole) > MAX_BEACONS:
        raise MeasurementError(
            f"{len(whole)} beacons; allowed are {LEAST} to {MAX_BEACONS}: "
            f"leave out {len(whole) - MAX_BEACONS}"
        )
    for one in whole.tolist():
        if not 0 <= one <= ID_MAX:
            raise MeasurementError(f"beacon id {one}; allowed are 0 to {ID_MAX}: renumber it")
    twice = [one for one, times in Counter(whole.tolist()).items() if times > 1]
    if twice:
        raise MeasurementError(
            f"beacon id {twice[0]} appears more than once; give each beacon its own id"
        )
    return whole.astype(np.int32)


def _checked_positions(positions_w: npt.ArrayLike, ids: npt.NDArray[np.int32]) -> Array:
    try:
        places = np.array(positions_w, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise MeasurementError(
            "beacon positions are not numbers; allowed is (N, 3), x y z in m"
        ) from error
    if places.shape != (len(ids), 3):
        raise MeasurementError(
            f"beacon positions of shape {places.shape} for {len(ids)} ids; "
            f"({len(ids)}, 3) is needed: x y z of each, m"
        )
    wrong = np.nonzero(~(np.abs(places) <= FARTHEST).all(axis=1))[0]
    if len(wrong):
        raise MeasurementError(
            f"beacon {ids[wrong[0]]} stands at {places[wrong[0]].tolist()} m; allowed are finite "
            f"numbers within ±{FARTHEST:g} m: give it in metres"
        )
    return places


def _plane(places: Array) -> tuple[Array, Array]:
    """Return centre and unit normal of the nearest plane. Raises DegenerateGeometryError."""
    center = places.mean(axis=0)
    from_center = places - center
    _, singular, axes = np.linalg.svd(from_center, full_matrices=False)
    extent = float(singular[0]) / math.sqrt(len(places))
    if not (singular[1] > IN_LINE * singular[0] and extent > 1e-6):
        raise DegenerateGeometryError(
            f"all {len(places)} beacons lie on one line or at one point; "
            "allowed are sets that span a plane: move one aside"
        )
    normal: Array = axes[2]
    if normal[np.argmax(np.abs(normal))] < 0.0:
        normal = -normal
    return center, normal.copy()


ROWS = ("beacon_w", "bearing_b", "beacon_id")
"""Fields of a BEARINGS_SAMPLE with one row for each beacon."""


class KnownBeacons:
    """The positions of a set of beacons by id."""

    def __init__(self, beacons: Beacons) -> None:
        self._places = dict(zip(beacons.ids.tolist(), beacons.positions_w.tolist(), strict=True))

    @property
    def ids(self) -> list[int]:
        return sorted(self._places)

    def with_positions(self, seen: Record) -> Record:
        """Return a BEARINGS_SAMPLE (1,) with beacon positions, without unknown beacons."""
        places, ids = self._places, beacon_ids_of(seen)
        known = [k for k, one in enumerate(ids) if one in places]
        frame = with_rows(seen, known)
        if known:
            frame["beacon_w"][0, : len(known)] = [places[ids[k]] for k in known]
        return frame


def with_rows(frame: Record, rows: list[int]) -> Record:
    """Return a copy of a BEARINGS_SAMPLE (1,) with only these of its rows."""
    kept = np.frombuffer(bytearray(frame.tobytes()), BEARINGS_SAMPLE)  # `copy` takes 5 times longer
    if len(rows) < frame["count"][0]:
        kept["count"] = len(rows)
        for field in ROWS:
            kept[field][0, : len(rows)] = frame[field][0, rows]
    return kept
