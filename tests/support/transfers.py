"""Transfers of a station on a good link."""

from __future__ import annotations

import time

from console.catalogue.catalogue import Catalogue
from console.parameters.station import RecorderParameters
from console.transfers.service import Transfers
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.node import Node


def new_transfers(station: Node, catalogue: Catalogue) -> Transfers:
    """Return the transfers of `quad1` to the runs of a catalogue.

    The disk may be nearly full.
    """
    return Transfers(
        station,
        catalogue,
        "quad1",
        RecorderParameters(keep_free=10.0),
        lambda: LinkState.GOOD,
        lambda level, line: None,
        time.time_ns,
    )
