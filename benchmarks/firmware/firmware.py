"""The C firmware compared with the Python one on recorded and fuzzed input, and its cost."""

from __future__ import annotations

import statistics

from benchmarks.firmware.chip import (
    BUDGET,
    FLASH_MAX,
    RAM_MAX,
    Cost,
    missing,
    simulated_chip,
    sizes,
)
from benchmarks.firmware.streams import answer, flown, fuzzed
from benchmarks.harness import Report, Row, Target
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.firmware.native import NativeFirmware

FRAMES, QUICK_FRAMES = 1_000_000, 20_000
ON_CHIP, QUICK_ON_CHIP = 60_000, 2_000
SHARE_MAX = 0.7
STREAMS = {"recorded": flown, "fuzzed": fuzzed}


def run(quick: bool) -> Report:
    """Feed both firmwares the same input, half recorded and half fuzzed."""
    rows: list[Row] = []
    frames = QUICK_FRAMES if quick else FRAMES
    different = 0
    for name, stream in STREAMS.items():
        python, native = Firmware(), NativeFirmware(2, "checked")
        unequal = sum(
            answer(native, step) != answer(python, step) for step in stream(1, frames // 2)
        )
        rows.append(Row(f"native, {name}", {"frames": frames // 2, "different": unequal}))
        different += unequal
    targets = [Target("frames that differ", different, 0)]
    absent = missing()
    if not absent:
        count = (QUICK_ON_CHIP if quick else ON_CHIP) // 2
        for name, stream in STREAMS.items():
            python, costs, unequal = Firmware(), list[Cost](), 0
            with simulated_chip() as chip:
                for step in stream(2, count):
                    got, cost = chip.answer(step)
                    unequal += got != answer(python, step)
                    costs.append(cost)
            periods = [cost.period for cost in costs]
            rows.append(
                Row(
                    f"simulated chip, {name}",
                    {
                        "frames": count,
                        "different": unequal,
                        "period, mean (cycles)": statistics.mean(periods),
                        "worst": max(periods),
                        "with frames, mean": statistics.mean(cost.cycles for cost in costs),
                        "with frames, worst": max(cost.cycles for cost in costs),
                        "stack (bytes)": costs[-1].stack,
                    },
                )
            )
            targets.append(Target(f"frames that differ on the chip, {name}", unequal, 0))
            if name == "recorded":
                worst = max(cost.cycles for cost in costs) / BUDGET
                targets.append(Target("worst share of 40,000 cycles in flight", worst, SHARE_MAX))
        flash, ram = sizes("judged.elf")
        targets.append(Target("flash (bytes), of the core", flash, FLASH_MAX))
        targets.append(Target("static RAM (bytes), with the judge's mailbox", ram, RAM_MAX))
    return Report(
        name="firmware",
        title="C firmware",
        conditions=[
            "the native build stops where a number overflows",
            "on the chip no interrupts run: a board's layer is not part of it",
        ],
        rows=rows,
        targets=targets,
        notes=[f"not simulated: {absent}"] if absent else [],
    )
