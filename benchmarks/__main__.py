"""Runs the benchmarks and writes their tables and plots.

    .venv/bin/python -m benchmarks [pose filters onboard closed_loop start] [--quick | --smoke]
                                   [--out DIR]

--smoke runs each in some seconds, to see that it still does: its figures mean nothing, no target is
judged, and what --out would write is thrown away. Without --out the tables are printed only. With
it DIR gets performance.md and the folder performance with the JSON and one PNG a plot.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import shutil
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.harness import CHROMIUM, Report, Size
from benchmarks.line_plot import draw_lines

FOLDERS = {
    "onboard": (
        "onboard",
        "closed_loop",
        "start",
        "loop_rate",
        "loop",
        "serial_line",
        "onboard_log",
        "board_links",
        "trajectories",
        "landings",
        "fault_library",
        "tracker_integrity",
    ),
    "estimation": (
        "pose",
        "filters",
        "comparison",
        "tags",
        "active_sensing",
        "network_localisation",
        "formation_faults",
    ),
    "explanation": ("explanations", "diagnosis", "fault_verdicts", "healthy"),
    "firmware": ("firmware",),
    "flights": (
        "board_flights",
        "fleet",
        "failures",
        "identification",
        "rough_world",
        "hostile_plugins",
        "foreign_laws",
        "law_rescues",
        "oscillation",
        "tracking_systems",
        "starved",
        "real_flights",
        "camera_flight",
    ),
    "campaigns": (
        "bearing_flights",
        "campaigns",
        "campaign_kills",
        "campaign_size",
        "disturbances",
        "faults",
        "fleet_flight",
        "hostile_flights",
        "tracking_faults",
    ),
    "page": (
        "replay",
        "sticks",
        "parameter_page",
        "run_list",
        "page_notice",
        "up_cost",
        "fleet_pace",
        "live_signals",
        "live_page",
        "late_ticks",
        "view_rate",
    ),
    "link": ("link", "hostile_bytes"),
    "logs": ("killed_logs", "logs", "large_log", "imports", "fuzz_logs", "fuzz_imports"),
    "peers": ("second_plant",),
    "safety": ("laboratory_faults", "emergencies", "hostile_doors", "foreign_page"),
}
NAMES = {name: f"benchmarks.{folder}.{name}" for folder, names in FOLDERS.items() for name in names}
"""The module of each benchmark, by its name."""
IN_CHROMIUM = (
    "replay",
    "sticks",
    "parameter_page",
    "run_list",
    "page_notice",
    "view_rate",
    "live_page",
    "starved",
    "foreign_page",
)
"""Benchmarks that measure nothing without Chromium."""
OWN_OPTIONS = {
    "count": ("fuzz_logs", "fuzz_imports", "firmware", "campaign_size"),
    "gigabytes": ("large_log",),
    "hours": ("oscillation", "tracker_integrity"),
    "seed": (
        "fuzz_logs",
        "fuzz_imports",
        "fault_verdicts",
        "firmware",
        "healthy",
        "hostile_bytes",
        "hostile_doors",
        "hostile_plugins",
        "law_rescues",
    ),
    "data": ("real_flights",),
    "against": ("up_cost", "late_ticks"),
    "only": ("failures", "hostile_plugins"),
    "flights": (
        "fault_verdicts",
        "healthy",
        "hostile_flights",
        "hostile_plugins",
        "law_rescues",
        "tracking_faults",
    ),
}
"""Options that only some benchmarks have, with the names of these."""


SIZES = {
    Size.QUICK: "fewer samples: a look, not a result",
    Size.SMOKE: "as short as possible: does it still run?",
}
"""The sizes next to the full one, with their descriptions."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NAMES))
    sizes = parser.add_mutually_exclusive_group()
    for size, text in SIZES.items():
        sizes.add_argument(f"--{size}", dest="size", action="store_const", const=size, help=text)
    parser.set_defaults(size=Size.FULL)
    parser.add_argument(
        "--count",
        type=int,
        help="of the fuzz tests: logs; of firmware: frames; of campaign_size: flights",
    )
    parser.add_argument(
        "--hours",
        type=float,
        help="of oscillation, tracker_integrity: flown without a cause for an alarm",
    )
    parser.add_argument("--gigabytes", type=float, help="of large_log: size of the log")
    parser.add_argument(
        "--seed", type=int, help="number of the first mutated log or flight, or stream"
    )
    parser.add_argument(
        "--flights",
        type=int,
        help="of fault_verdicts, hostile_flights, or a kind of hostile_plugins and law_rescues",
    )
    parser.add_argument(
        "--only",
        help="of hostile_plugins: law, estimator, behavior or sensor; of failures: another plan, "
        "as betaflight, crazyflie, c or rough",
    )
    parser.add_argument("--data", type=Path, help="of real_flights: folder of recorded flights")
    parser.add_argument(
        "--against", help="of up_cost, late_ticks: another checkout, measured in turns"
    )
    parser.add_argument("--out", type=Path, help="folder for performance.md, JSON and plots")
    options = parser.parse_args()
    if options.size is Size.SMOKE and options.out:
        parser.error("--smoke writes nothing, as its figures mean nothing: leave out --out")
    unknown = [name for name in options.names if name not in NAMES]
    if unknown:
        parser.error(f"no benchmark is called {unknown[0]!r}: there are {', '.join(NAMES)}")
    more: dict[str, Any] = {}
    for name, of in OWN_OPTIONS.items():
        if (value := getattr(options, name)) is not None:
            more[name] = value
            if not options.names or set(options.names) - set(of):
                parser.error(f"--{name} belongs to {' and '.join(of)} alone")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends all processes of a flight
    with ExitStack() as stack:
        if options.size is Size.SMOKE:
            options.out = Path(stack.enter_context(TemporaryDirectory(prefix="quadlab-smoke-")))
        reports = run(options.names or list(NAMES), options.size, options.out, more)
    is_met = all(target.met for report in reports for target in report.targets)
    return 0 if is_met or options.size is Size.SMOKE else 1


def run(
    names: Sequence[str], size: Size, out: Path | None, more: Mapping[str, Any]
) -> list[Report]:
    """Run benchmarks, print their reports, and write them to the folder `out` if there is one.

    Args:
        more: options of these benchmarks' own.
    """
    conditions = machine()
    reports: list[Report] = []
    for name in names:
        if name in IN_CHROMIUM and shutil.which(CHROMIUM) is None:
            print(f"{name}: left out, because Chromium is not installed", file=sys.stderr)
            continue
        print(f"{name} …", file=sys.stderr, flush=True)
        began = time.perf_counter()
        made = importlib.import_module(NAMES[name]).run(size=size, **more)
        for report in [made] if isinstance(made, Report) else made:  # a long one reports in parts
            print(f"{report.name}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
            print(report.as_markdown(), flush=True)
            reports.append(report)
            if out:  # written after each one, so that an error in the next does not lose it
                write(out, names, reports, conditions, size)
    return reports


def machine() -> dict[str, str]:
    """Return the conditions on which the figures depend: processor, packages and the like."""
    model = next(
        (line.split(":")[1].strip() for line in _cpu_lines() if line.startswith("model name")),
        platform.processor(),
    )
    packages = ", ".join(f"{p} {version(p)}" for p in ("numpy", "numba", "opencv-python-headless"))
    return {
        "date": time.strftime("%Y-%m-%d"),
        "processor": f"{model}, {os.cpu_count()} cores",
        "python": f"{platform.python_version()}, {packages}",
        "load before": " ".join(f"{x:.2f}" for x in os.getloadavg()),
    }


def _cpu_lines() -> list[str]:
    file = Path("/proc/cpuinfo")
    return file.read_text().splitlines() if file.exists() else []


def write(
    out: Path, asked: Sequence[str], reports: list[Report], conditions: dict[str, str], size: Size
) -> None:
    """Write `out`/performance.md, and the folder performance with the JSON and the plots."""
    beside = out / "performance"
    beside.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Performance",
        "",
        f"Written by `python -m benchmarks {' '.join(asked)} --out DIR`;",
        "every peer ran in the same run,",
        "in turns with ours. Times are medians of rounds, ratios medians of the rounds' ratios.",
        "",
        *(f"- {key}: {value}" for key, value in conditions.items()),
        *(["- **quick run: too few samples for a result**"] if size is Size.QUICK else []),
        "",
    ]
    # Figures first: a plot that fails must not lose minutes of measuring.
    document = {"conditions": conditions, "reports": [r.as_json() for r in reports]}
    (beside / "performance.json").write_text(json.dumps(document, indent=1, default=float) + "\n")
    for report in reports:
        lines.append(report.as_markdown())
        if report.plot and draw(report.plot, beside / f"{report.name}.png"):
            lines.append(f"![{report.title}](performance/{report.name}.png)\n")
    (out / "performance.md").write_text("\n".join(lines))


def draw(plot: dict[str, Any], path: Path) -> bool:
    """Draw one scatter plot of accuracy over time, or one figure per method.

    Returns False without matplotlib.

    Args:
        plot: kind "scatter" (x, y, labels), or "figures" (values, labels); x_label, y_label, and
            optionally limit: a horizontal line with the text limit_label. Or kind "lines" with
            panels, see benchmarks.line_plot.
    """
    try:
        import matplotlib
    except ImportError:
        print("no plots: matplotlib is not installed", file=sys.stderr)
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot

    if plot["kind"] == "lines":
        draw_lines(plot["panels"], path)
        return True
    figure, axes = pyplot.subplots(figsize=(9.0, 4.5), layout="constrained")
    if plot["kind"] == "scatter":
        # Numbers at the points and names next to the axes, as names at the points would overlap.
        points = sorted(zip(plot["y"], plot["x"], plot["labels"], strict=True), reverse=True)
        for number, (y, x, label) in enumerate(points, start=1):
            axes.plot(x, y, "o", color="#1f6f8b", label=f"{number}  {label}")
            offset = (-13, -4) if number % 2 else (7, -4)
            axes.annotate(f"{number}", (x, y), xytext=offset, textcoords="offset points")
        axes.loglog()
        axes.margins(x=0.12, y=0.12)
    else:
        # Dots rather than bars: a logarithmic axis has no zero from which a bar could start.
        axes.plot(plot["values"], plot["labels"], "o", color="#1f6f8b")
        for value, label in zip(plot["values"], plot["labels"], strict=True):
            axes.annotate(
                f"{value:.3g}",
                (value, label),
                xytext=(8, -3),
                textcoords="offset points",
                fontsize=8,
            )
        axes.set_xscale("log")
        axes.margins(x=0.2)
        axes.invert_yaxis()
    if "limit" in plot:
        line = axes.axhline if plot["kind"] == "scatter" else axes.axvline
        line(plot["limit"], color="#b3402e", linewidth=1.0, linestyle="--")
        axes.plot([], [], color="#b3402e", linestyle="--", label=plot.get("limit_label", "limit"))
    if plot["kind"] == "scatter":
        axes.legend(
            frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0), handlelength=1.2, fontsize=8
        )
    axes.set_xlabel(plot["x_label"])
    axes.set_ylabel(plot.get("y_label", ""))
    axes.grid(True, which="major", alpha=0.3)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
    return True


if __name__ == "__main__":
    sys.exit(main())
