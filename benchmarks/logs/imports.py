"""A file of 100 MB of each format, imported by `quadlab log import` in a process of its own.

    python -m benchmarks imports [--quick]

The flight is one of 1000 Hz, as long as the size allows.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.logs.foreign_logs import FORMATS, Format
from benchmarks.logs.logs import measured
from extensions.importers.tests.foreign_flight import make_flight, write_mapping

BYTES = 100e6, 10e6, 0.5e6  # of each size
FIRST = 6.4  # s of the flight by which bytes a second are found
STEP = 0.001
MOST_S = 10.0


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    wanted = size.of(*BYTES)
    report = Report(
        "imports",
        "Import of a file of each format",
        [f"files of {wanted / 1e6:.0f} MB at 1000 Hz; each import in a process of its own"],
    )
    for kind in size.some(FORMATS, 3):
        with tempfile.TemporaryDirectory(prefix="quadlab-imports-") as name:
            folder = Path(name)
            path = _written(folder, FORMATS[kind], wanted)
            chosen = FORMATS[kind].mapping
            if chosen == "file":
                mapping = folder / "mapping.toml"
                chosen = str(write_mapping(mapping, 'angular_velocity_unit = "rad/s"'))
            words = ["log", "import", str(path), *(["--mapping", chosen] if chosen else [])]
            found = measured(
                sys.executable, "-m", "quadlab", *words, "--data", str(folder / "data")
            )
            figures: dict[str, float | str] = {
                "MB of the file": _bytes(path) * 1e-6,
                "s": found.seconds,
                "processor, s": found.busy,
                "MB": found.megabytes,
            }
            report.rows.append(Row(kind, figures))
            report.targets.append(Target(f"{kind}: processor, s", found.busy, MOST_S))
    return report


def _written(folder: Path, kind: Format, wanted: float) -> Path:
    """Write a flight whose file has about as many bytes as are wanted."""
    small, large = folder / "small", folder / "large"
    small.mkdir()
    large.mkdir()
    share = wanted / _bytes(kind.write(small, make_flight(seconds=FIRST, step=STEP)))
    return kind.write(large, make_flight(seconds=FIRST * share, step=STEP))


def _bytes(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(one.stat().st_size for one in files)
