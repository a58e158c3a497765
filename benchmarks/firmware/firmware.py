"""The C firmware compared with the Python one on recorded and fuzzed input, and its cost.

With --seed and --count a long run is made in parts, each of other flights and other noise.
"""

from __future__ import annotations

import statistics

from benchmarks.firmware.chip import FLASH_MAX, RAM_MAX, missing, simulated_chip, sizes
from benchmarks.firmware.image import judge
from benchmarks.firmware.streams import answer, flown, fuzzed
from benchmarks.harness import Report, Row, Size, Target
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.firmware.native import NativeFirmware

FRAMES = 1_000_000, 20_000, 2_000  # of each size
ON_CHIP = 0.03, 0.1, 0.2
"""The share of the frames that the simulated chip gets, too, of each size."""
SHARE_MAX = 0.7
SETTLED = 10
"""Number of periods after power-up that the worst load leaves out."""
STREAMS = {"recorded": flown, "fuzzed": fuzzed}


def run(size: Size = Size.FULL, seed: int = 1, count: int = 0) -> Report:
    """Feed both firmwares the same input, half recorded and half fuzzed.

    Args:
        count: number of frames in all; 0 takes FRAMES of the size.
    """
    rows: list[Row] = []
    frames = count or size.of(*FRAMES)
    different = 0
    for name, stream in STREAMS.items():
        python, native = Firmware(), NativeFirmware(2, "checked")
        unequal = sum(
            answer(native, step) != answer(python, step) for step in stream(seed, frames // 2)
        )
        rows.append(Row(f"native, {name}", {"frames": frames // 2, "different": unequal}))
        different += unequal
    targets = [Target("frames that differ", different, 0)]
    absent = missing()
    if not absent:
        periods, stack = int(frames * size.of(*ON_CHIP)) // 2, 0
        for name, stream in STREAMS.items():
            with simulated_chip() as chip:
                judged = judge(chip, stream(seed + 1, periods))
            load, worst = statistics.mean(judged.shares), max(judged.shares[SETTLED:])
            stack = max(stack, judged.stack)
            rows.append(
                Row(
                    f"image on the simulated chip, {name}",
                    {
                        "periods": judged.periods,
                        "bytes compared": judged.sent,
                        "different": judged.different or "nothing",
                        "late periods": judged.overruns,
                        "load": load,
                        "load, worst period": worst,
                        "stack (bytes)": judged.stack,
                    },
                )
            )
            targets.append(
                Target(f"runs that differ on the chip, {name}", bool(judged.different), 0)
            )
            targets.append(Target(f"late periods, {name}", judged.overruns, 0))
            if name == "recorded":
                what = "share of the cycles at 500 Hz in flight, worst period"
                targets.append(Target(what, worst, SHARE_MAX))
        flash, ram = sizes()
        targets.append(Target("flash (bytes)", flash, FLASH_MAX))
        targets.append(Target("RAM with the worst stack (bytes)", ram + stack, RAM_MAX))
    return Report(
        name="firmware",
        title="C firmware",
        conditions=[
            "the native build stops where a number overflows",
            "the whole image runs in simavr: bytes by its serial lines, readings by its "
            "converter's inputs, references by its bus",
        ],
        rows=rows,
        targets=targets,
        notes=[f"not simulated: {absent}"] if absent else [],
    )
