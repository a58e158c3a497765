"""Transfers of a station on a good link."""

from __future__ import annotations

import time
from types import SimpleNamespace

from console.catalogue.catalogue import Catalogue
from console.parameters.station import RecorderParameters
from console.transfers.service import Transfers
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.node import Node


def new_transfers(station: Node, catalogue: Catalogue) -> Transfers:
    """Return the transfers of `quad1` to the runs of a catalogue.

    The disk may be nearly full.
    """
    context = SimpleNamespace(
        node=station,
        vehicle="quad1",
        link=SimpleNamespace(state=lambda: LinkState.GOOD, vehicle_ns=time.time_ns),
        parameters=SimpleNamespace(recorder=RecorderParameters(keep_free=10.0)),
        outbox=SimpleNamespace(say=lambda level, line: None),
    )
    return Transfers(context, catalogue)  # type: ignore[arg-type]
