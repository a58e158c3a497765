"""The replica of another process's parameters: a snapshot, and the changes since.

Changes, answers to changes and snapshots arrive by different paths and overtake each other. Each
carries the revision at which its process applied it and the instance of that process, so that all
replicas end with the same value.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import NamedTuple

from quadrotor.parameter_description import ParameterValue
from vehicle_link.clock import monotonic
from vehicle_link.parameters.change import VEHICLE, authority_of

MISSED = 0.5
"""Seconds for which changes up to the vehicle's revision may be missing without a snapshot."""


class Snapshot(NamedTuple):
    """An applied snapshot, and the previous contents of the replica."""

    before: dict[str, ParameterValue]
    values: dict[str, ParameterValue]
    revision: int
    instance: int
    instance_before: int | None  # None for the first snapshot


class ParameterReplica:
    """A replica of a vehicle's parameters, and of its station's and simulator's if they are given.

    An older value never replaces a newer one; revisions of different processes are not compared.
    Thread-safe.

    Args:
        values: known from before, and not yet confirmed by any process.

    Attributes:
        revision: the vehicle's newest revision; -1 before the first one.
        instance: of the vehicle's process from which the last snapshot is; None before the first.
        shown: (instance, revision) in the vehicle's status; None before the first one.
        clock: number of updates applied so far.
        is_whole: whether there is a snapshot since which no change can have been lost.
    """

    def __init__(self, values: Mapping[str, ParameterValue] | None = None) -> None:
        self._lock = threading.Lock()
        self._values = dict(values or {})
        self._revisions: dict[str, int] = {}
        self._taken: dict[str, int] = {}  # value of `clock` when it was applied
        self._instances: dict[str, int] = {}  # by authority, whose revisions are kept
        self.is_whole = False
        self._behind_since: float | None = None
        self._complete = -1  # the vehicle's revision up to which no change is missing
        self._beyond: set[int] = set()  # revisions received beyond a missing one
        self.revision = -1
        self.instance: int | None = None
        self.shown: tuple[int, int] | None = None
        self._is_outdated = False  # of `shown`
        self.clock = 0

    # ------------------------------------------------------------------ updates
    def note_status(self, instance: int, revision: int) -> None:
        """Store the instance and revision that the vehicle reports in its status."""
        with self._lock:
            self.shown, self._is_outdated = (instance, revision), False
            if self._is_behind():
                self._behind_since = self._behind_since or monotonic()
            else:
                self._behind_since = None

    def mark_incomplete(self) -> None:
        """Note that changes may have been lost, and a snapshot is due.

        The next status tells of which process it is: the vehicle may have restarted, and its new
        process would answer in the name of the old one.
        """
        with self._lock:
            self.is_whole, self._is_outdated = False, True

    def load(
        self,
        values: Mapping[str, ParameterValue],
        revision: int,
        instance: int = 0,
        since: int | None = None,
    ) -> Snapshot:
        """Apply a snapshot of all values.

        Args:
            revision: the vehicle's revision that these values have at least.
            since: value of `clock` when reading began: values that arrived later are newer and
                stay.
        """
        with self._lock:
            before, instance_before = self._values, self.instance
            if not self.is_whole or instance != instance_before:
                for authority in {authority_of(name) for name in before}:
                    if authority != VEHICLE or self._instances.get(VEHICLE) != instance:
                        self._forget(authority)
                self.revision = self._newest()
                self._instances[VEHICLE] = instance
            newer = {n for n, at in self._taken.items() if since is not None and at > since}
            self._values = {n: before[n] if n in newer else v for n, v in values.items()}
            for name in values:
                if name not in newer and authority_of(name) == VEHICLE:
                    self._revisions[name] = max(self._revisions.get(name, -1), revision)
            self.revision = max(self.revision, revision)
            self._complete = max(self._complete, revision)
            self._advance_complete()
            self.instance, self.is_whole, self._behind_since = instance, True, None
            return Snapshot(before, dict(self._values), revision, instance, instance_before)

    def apply(
        self, values: Mapping[str, ParameterValue], revision: int, instance: int | None = None
    ) -> dict[str, ParameterValue]:
        """Apply the values of a change, or of the answer to a change; return the values that are
        new.

        Args:
            revision: of their authority; values that are newer than that stay.
            instance: of the process that counts the revisions; another process counts from the
                start.
        """
        news = {}
        with self._lock:
            self.clock += 1
            for name, value in values.items():
                authority = authority_of(name)
                known = self._instances.setdefault(authority, instance) if instance else instance
                if known != instance:
                    self._forget(authority)
                    self._instances[authority] = instance or 0
                if authority == VEHICLE:
                    self._beyond.add(revision)
                if revision < self._revisions.get(name, -1):
                    continue
                self._revisions[name], self._taken[name] = revision, self.clock
                if authority == VEHICLE:
                    self.revision = max(self.revision, revision)
                if self._values.get(name) != value:
                    self._values[name] = news[name] = value
            self._advance_complete()
        return news

    # ------------------------------------------------------------------ queries
    @property
    def in_step(self) -> bool:
        """Return whether the values are those that the vehicle reports."""
        with self._lock:
            return self.shown is not None and not self._is_behind()

    @property
    def is_due(self) -> bool:
        """Return whether a snapshot is due: the first, of another process, or for a lost change."""
        with self._lock:
            if self.shown is None or self._is_outdated:
                return False
            if not self.is_whole or self.shown[0] != self.instance:
                return True
            since = self._behind_since
            return since is not None and monotonic() - since > MISSED

    def value(self, name: str) -> ParameterValue | None:
        """Return the newest value; None when it is not known."""
        return self._values.get(name)

    def values(self) -> dict[str, ParameterValue]:
        """Return the newest values of all parameters."""
        with self._lock:
            return dict(self._values)

    def revision_of(self, name: str) -> int:
        """Return the revision at which `name` was applied, -1 if unknown."""
        return self._revisions.get(name, -1)

    # ------------------------------------------------------------------ internals
    def _is_behind(self) -> bool:
        instance, revision = self.shown or (None, -1)
        return self.instance is None or instance != self.instance or revision > self._complete

    def _advance_complete(self) -> None:
        """Advance `_complete` over the revisions that follow it without a gap: each change has
        the next number.
        """
        while self._complete + 1 in self._beyond:
            self._complete += 1
        self._beyond = {revision for revision in self._beyond if revision > self._complete}

    def _forget(self, authority: str) -> None:
        """Forget the revisions of a process that has ended."""
        for name in [name for name in self._revisions if authority_of(name) == authority]:
            del self._revisions[name]
            self._taken.pop(name, None)
        if authority == VEHICLE:
            self.revision = self._complete = -1
            self._beyond.clear()

    def _newest(self) -> int:
        """Return the newest revision of any of the vehicle's values."""
        revisions = [r for name, r in self._revisions.items() if authority_of(name) == VEHICLE]
        return max(revisions, default=-1)
