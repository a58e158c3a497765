"""Mutated files of all formats that `quadlab log import` reads.

    python -m benchmarks fuzz_imports [--count N] [--seed N]

Each file is imported by a process of its own, forked from one that has loaded the readers. A
problem is a traceback, a warning, a status that is none of 0, 1, 2, more than 30 s of processor
time, or more than 500 MB.
"""

from __future__ import annotations

import gzip
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from zstandard import ZstdCompressor

from benchmarks.harness import Report, Row, Size, Target
from extensions.export.export import export
from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.blackbox_writer import flight_log
from extensions.importers.tests.crazyflie_writer import write_crazyflie
from extensions.importers.tests.foreign_flight import (
    columns_of,
    make_flight,
    write_csv,
    write_mapping,
)
from extensions.importers.tests.test_blackbox import ROWS
from extensions.importers.tests.test_dataflash import flight_of
from extensions.importers.tests.ulog_writer import write_ulog
from extensions.mavlink.tests.test_tlog import flight as telemetry
from quadlab.__main__ import main
from tests.crafted_logs import mutated, sound

COUNT = 2000, 130, 13  # of each size
MOST_MB = 500.0
LONGEST = 30  # s of processor time
HANGS = 600  # s of a busy computer, after which a process that waits is ended
SECONDS = 6.0  # of a flight
FLIGHT = make_flight(seconds=SECONDS)


class Done(NamedTuple):
    """The result of one import."""

    status: int
    seconds: float  # of processor time
    peak: float  # MB
    said: str


def _csv(folder: Path) -> Path:
    return write_csv(folder / "flight.csv", columns_of(FLIGHT))


def _npy(folder: Path) -> Path:
    table = np.stack(list(columns_of(FLIGHT).values()), axis=1)
    names = [(name, "f8") for name in columns_of(FLIGHT)]
    np.save(folder / "flight.npy", np.ascontiguousarray(table).view(names)[:, 0])
    return folder / "flight.npy"


def _hdf5(folder: Path) -> Path:
    with h5py.File(folder / "flight.hdf5", "w") as file:
        file["ts"], file["gyro_raw"], file["accel_raw"] = FLIGHT.seconds, FLIGHT.rate, FLIGHT.force
        file["traj_target"] = np.hstack([FLIGHT.position, FLIGHT.quaternion[:, [1, 2, 3, 0]]])
    return folder / "flight.hdf5"


def _ulog(folder: Path) -> Path:
    kind = [("timestamp", "<u8"), ("gyro_rad", "<f4", 3), ("accelerometer_m_s2", "<f4", 3)]
    rows = np.zeros(len(FLIGHT.seconds), kind)
    rows["timestamp"] = np.round((FLIGHT.seconds - FLIGHT.seconds[0]) * 1e6)
    rows["gyro_rad"] = FLIGHT.rate * [1, -1, -1]
    rows["accelerometer_m_s2"] = FLIGHT.force * [1, -1, -1]
    return write_ulog(folder / "flight.ulg", {"sensor_combined": rows})


def _crazyflie(folder: Path) -> Path:
    us = np.round((FLIGHT.seconds - FLIGHT.seconds[0]) * 1e6).astype(np.int64)
    columns = {
        **{f"gyro_{a}": np.degrees(FLIGHT.rate[:, k]) for k, a in enumerate("xyz")},
        **{f"acc_{a}": FLIGHT.force[:, k] / 9.80665 for k, a in enumerate("xyz")},
        **{f"stateEstimate_{a}": FLIGHT.position[:, k] for k, a in enumerate("xyz")},
    }
    return write_crazyflie(folder / "log00", "fixedFrequency", us, **columns)


def _bytes(name: str, make: Callable[[], bytes]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / name).write_bytes(make())
        return folder / name

    return write


def _packed(pack: Callable[[bytes], bytes], ending: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        plain = _csv(folder)
        packed = plain.with_name(f"{plain.name}.{ending}")
        packed.write_bytes(pack(plain.read_bytes()))
        return packed

    return write


def _bag(folder: Path) -> Path:
    return write_bag(folder / "flight.bag", FLIGHT, 1)


def _mcap(folder: Path) -> Path:
    [found] = write_bag(folder / "flight", FLIGHT, 2, mcap=True).glob("*.mcap")
    return Path(shutil.copy(found, folder / "flight.mcap"))


def _mat(folder: Path) -> Path:
    return export(sound(folder / "sound.mcap"), folder / "out", "mat").files[0]


FORMATS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "csv": (_csv, "file"),
    "npy": (_npy, "file"),
    "hdf5": (_hdf5, "blackbird"),
    "ulog": (_ulog, ""),
    "crazyflie": (_crazyflie, ""),
    "blackbox": (_bytes("flight.bbl", lambda: flight_log(ROWS)), ""),
    "dataflash": (_bytes("flight.bin", lambda: flight_of(600).data), ""),
    "tlog": (_bytes("flight.tlog", lambda: b"".join(telemetry())), ""),
    "rosbag": (_bag, ""),
    "mcap": (_mcap, ""),
    "gzip": (_packed(gzip.compress, "gz"), "file"),
    "zstd": (_packed(ZstdCompressor().compress, "zst"), "file"),
    "mat": (_mat, ""),
}
"""Writers of a sound file by format, and the mapping: a name, a file, or the format's default."""


def imported(file: Path, words: list[str], folder: Path) -> Done:
    """Import a file in a process of its own."""
    said = folder / "said.txt"
    process = os.fork()
    if not process:
        status = 99
        try:
            signal.alarm(HANGS)
            resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
            output = os.open(said, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
            os.dup2(output, 1), os.dup2(output, 2)
            status = main(["log", "import", str(file), *words, "--data", str(folder / "data")])
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    _, status, used = os.wait4(process, 0)
    return Done(
        os.waitstatus_to_exitcode(status),
        used.ru_utime + used.ru_stime,
        used.ru_maxrss * 1024e-6,
        said.read_text(errors="replace"),
    )


def is_problem(done: Done) -> bool:
    wrong = "Traceback" in done.said or re.search(r"\wWarning: ", done.said) is not None
    return wrong or done.status not in (0, 1, 2) or done.seconds > LONGEST or done.peak > MOST_MB


def run(size: Size = Size.FULL, count: int | None = None, seed: int = 0) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    count = count or size.of(*COUNT)
    problems: list[str] = []
    results: dict[str, list[Done]] = {name: [] for name in FORMATS}
    with tempfile.TemporaryDirectory(prefix="quadlab-fuzz-") as name:
        folder = Path(name)
        mapping = write_mapping(folder / "mapping.toml", 'angular_velocity_unit = "rad/s"')
        sounds = {}
        for kind, (write, _) in FORMATS.items():
            (folder / kind).mkdir()
            sounds[kind] = write(folder / kind)
        for k in range(count):
            kind = list(FORMATS)[k % len(FORMATS)]
            whole, chosen = sounds[kind], FORMATS[kind][1]
            file = folder / f"mutated{''.join(whole.suffixes)}"
            file.write_bytes(mutated(whole.read_bytes(), seed + k))
            named = str(mapping) if chosen == "file" else chosen
            words = [*(["--mapping", named] if chosen else []), *(["--torn"] if k % 2 else [])]
            done = imported(file, words, folder)
            results[kind].append(done)
            if is_problem(done):
                last = done.said.strip()[-300:]
                problems.append(
                    f"{kind}, mutation {seed + k}: status {done.status}, {done.seconds:.1f} s, "
                    f"{done.peak:.0f} MB, {last}"
                )
                print(problems[-1], file=sys.stderr)
            shutil.rmtree(folder / "data", ignore_errors=True)
            if k % 100 == 99:
                print(f"{k + 1} files, {len(problems)} problems", file=sys.stderr, flush=True)
    return _report(count, seed, results, problems)


def _report(count: int, seed: int, results: dict[str, list[Done]], problems: list[str]) -> Report:
    report = Report(
        "fuzz_imports",
        "Mutated files of other systems",
        [f"{count} files, mutations from number {seed}", *problems[:20]],
    )
    for kind, found in results.items():
        if found:
            values: dict[str, float | str] = {
                "files": len(found),
                "refused": sum(one.status != 0 for one in found),
                "most, s": max(one.seconds for one in found),
                "most, MB": max(one.peak for one in found),
            }
            report.rows.append(Row(kind, values))
    report.targets.append(Target("problems", len(problems), 0.0))
    return report
