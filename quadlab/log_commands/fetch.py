"""`quadlab log fetch [NAME]`: the vehicle's own logs, through the station on this machine."""

from __future__ import annotations

import queue
import time
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, cast

import tyro

from quadlab.log_commands.log_file import progress_of
from quadlab.option_types import Flag, optional
from quadlab.vehicle_names import check_name
from quadrotor.errors import LinkError, StorageError, UsageError

if TYPE_CHECKING:
    from quadlab.station_client import StationClient
    from vehicle_link.messages.records import (
        Message,
        OnboardFile,
        OnboardFilesResponse,
        Transfer,
        Transfers,
    )

NEWEST = "newest"
SILENT = 10.0
"""Seconds without a report from the station after which the command gives up."""
ENDED = ("done", "incomplete", "failed", "cancelled")


@dataclass
class Fetch:
    """List the vehicle's own logs, or fetch one; an interrupted transfer is resumed."""

    log: Annotated[str | None, tyro.conf.Positional, optional("NAME")] = None
    """name of a log on board, or newest (default: list them)"""
    cancel: Flag = False
    """stop fetching it, and delete the part that has arrived"""
    loopback_port: int = 7447
    """TCP port of the station's session on loopback; --link-port of `quadlab up`"""
    name: str = "quad1"
    """namespace of the vehicle's topics"""

    def run(self) -> int:
        from quadlab.station_client import station

        check_name(self.name)
        if self.cancel and self.log is None:
            raise UsageError("--cancel needs the name of a log: quadlab log fetch NAME --cancel")
        with station(self.loopback_port, self.name) as client:
            if self.cancel:
                client.ask("transfer", action="cancel", name=self.log)
                print(f"{self.log} is no longer being fetched")
                return 0
            answer = client.ask("onboard_files")
            if self.log is None:
                return _list(self.name, answer)
            return _fetch(client, self._chosen(answer.files))

    def _chosen(self, files: list[OnboardFile]) -> str:
        """Return the log's name, given with or without its ending. Raises StorageError."""
        if not files:
            raise StorageError(f"{self.name} has no logs; it writes one from arming to disarming")
        if self.log == NEWEST:
            return str(files[0].name)
        names = [str(one.name) for one in files]
        for name in names:
            if self.log in (name, name.removesuffix(".mcap")):
                return name
        raise StorageError(
            f"{self.name} has no log {self.log!r:.80}; the newest is {names[0]}, "
            "quadlab log fetch lists all"
        )


def _list(vehicle: str, answer: OnboardFilesResponse) -> int:
    if not answer.files:
        print(f"{vehicle} has no logs; it writes one from arming to disarming")
        return 0
    width = max(len(one.name) for one in answer.files)
    for one in answer.files:
        start = f"{datetime.fromtimestamp(one.start_ns * 1e-9):%Y-%m-%d %H:%M:%S}"
        lasted = f"{(one.end_ns - one.start_ns) * 1e-9:8.1f} s"
        if not one.start_ns:
            start, lasted = " " * 19, " " * 10
        open_ = "being written" if one.start_ns else "torn, not repaired yet"
        state = "repaired" if one.recovered else "closed" if one.closed else open_
        print(f"{one.name:{width}}  {start} {lasted} {one.size / 1e6:8.1f} MB  {state}")
    print(f"{answer.free_bytes / 1e9:.1f} GB are free on board; quadlab log fetch NAME fetches one")
    return 0


def _fetch(client: StationClient, name: str) -> int:
    """Follow the transfer to its end. Raises LinkError when the station falls silent."""
    messages = client.listen("transfers")
    began = time.monotonic()
    number = int(client.ask("transfer", action="download", name=name).id)
    said, size = "", 0
    with progress_of(f"fetching {name}") as progress:
        while True:
            transfer = _report(messages, number, name)
            size = int(transfer.total_bytes) or size
            if transfer.total_bytes:
                progress(transfer.bytes / transfer.total_bytes)
            if transfer.phase in ENDED:
                break
            if transfer.problem and transfer.problem != said:
                print(f"{transfer.phase}: {transfer.problem}")
            said = transfer.problem
    if transfer.phase != "done":
        raise StorageError(f"{name} was not fetched, {transfer.phase}: {transfer.problem}")
    took = time.monotonic() - began
    how = transfer.problem or f"{size / 1e6:.1f} MB in {took:.1f} s"
    print(f"{name} is in the folder onboard/ of the station's data folder: {how}")
    return 0


def _report(messages: queue.SimpleQueue[Message], number: int, name: str) -> Transfer:
    """Return the station's next report of the transfer with this number."""
    end = time.monotonic() + SILENT
    while (left := end - time.monotonic()) > 0.0:
        try:
            message = messages.get(timeout=left)
        except queue.Empty:
            break
        for one in cast("Transfers", message).transfers:
            if one.id == number:
                return one
    raise LinkError(
        f"the station has not reported on {name} for {SILENT:g} s; the transfer continues: run "
        "the command again to follow it"
    )
