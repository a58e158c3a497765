"""The link to each board in `quadlab up`, beside what its line could carry.

    python -m benchmarks board_links

Each simulated board hovers in real time: commands a second, round trip, lateness of the ticks. The
limit is computed from the bytes of our own frames at the line's rate; Betaflight's bytes are sent
without the delay of a line, and so its round trip is that of the processes alone.
"""

from __future__ import annotations

import statistics
import time

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.page.laboratory import started
from benchmarks.page.up_cost import SETTLED, pilot
from extensions.betaflight import NAME as BETAFLIGHT
from extensions.betaflight.board.board import CRSF_BAUD_RATE
from extensions.betaflight.board.messages import Function
from extensions.betaflight.msp.crsf import encode_channels
from extensions.betaflight.msp.frames import REPLY, encode
from extensions.betaflight.simulated.process import FIRMWARE
from extensions.crazyflie import NAME as CRAZYFLIE
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle_link.serial.commands import encode_command
from vehicle_link.serial.port import BAUD_RATE

PORT, LINK_PORT = 28110, 28480
SECONDS = 20.0, 6.0, 1.0  # of each size
LOOK = 1.0  # s
HELD = 0.95
"""Least share of its rate that each board must be commanded at."""
BITS = 10
"""Bits of a byte on a serial line."""
IMU_BYTES = 18
"""Bytes of the payload of MSP's RAW_IMU."""
NAMES = ("board_command_rate", "board_round_trip", "lateness_p99", "missed_share")


def limits() -> dict[str, tuple[float, float]]:
    """Return {board: (commands a second, s of a round trip)} of the lines alone; 0: no limit."""
    answer = encode(Function.RAW_IMU, bytes(IMU_BYTES), REPLY)
    asked = len(encode(Function.RAW_IMU)) + len(answer)
    return {
        MIKROKOPTER: (2 * BAUD_RATE / BITS / len(encode_command((0, 0, 0, 0))), 0.0),
        BETAFLIGHT: (CRSF_BAUD_RATE / BITS / len(encode_channels(())), asked * BITS / BAUD_RATE),
        CRAZYFLIE: (0.0, 0.0),  # a radio's packets have no fixed time
    }


def run(size: Size = Size.FULL) -> Report:
    """Fly each board that can be simulated on this machine."""
    seconds = size.of(*SECONDS)
    report = Report(
        "board_links",
        "Links to the boards",
        [f"one simulated vehicle hovers in real time; means of {seconds:g} s"],
    )
    for board, (commands, round_trip) in size.some(limits().items()):
        if board == BETAFLIGHT and not FIRMWARE.exists():
            report.notes.append("no Betaflight: scripts/betaflight builds it")
            continue
        found = measure(board, size)
        report.rows.append(
            Row(
                board,
                {
                    "commands (Hz)": found["board_command_rate"],
                    "the lines' limit (Hz)": commands or "-",
                    "round trip (ms)": 1e3 * found["board_round_trip"] or "-",
                    "the line's share (ms)": 1e3 * round_trip or "-",
                    "lateness p99 (ms)": 1e3 * found["lateness_p99"],
                    "missed (%)": 100.0 * found["missed_share"],
                    "hovered (%)": 100.0 * found["hovered"],
                },
            )
        )
        rate = find_kind(board).rate
        held = found["board_command_rate"] / rate
        report.targets.append(
            Target(f"{board}: share of {rate} commands a second", held, HELD, at_most=False)
        )
    return report


def measure(board: str, size: Size) -> dict[str, float]:
    """Return the means of the status while a board hovers, and the share of the looks it did."""
    began = time.monotonic()
    found: dict[str, list[float]] = {name: [] for name in NAMES}
    with (
        started(PORT, LINK_PORT, "--board", board) as (_, lines),
        pilot(lines, PORT, began) as flown,
    ):
        flown.take_off()
        time.sleep(size.of(*SETTLED))
        looks, end = 0, time.monotonic() + size.of(*SECONDS)
        while time.monotonic() < end:
            time.sleep(LOOK)
            status, looks = flown.summary()["status"], looks + 1
            if status["behavior"] == "hover":  # a late computer may make it land
                for name, values in found.items():
                    values.append(float(status[name]))
    means = {name: statistics.fmean(values or [0.0]) for name, values in found.items()}
    return means | {"hovered": len(found["missed_share"]) / looks}
