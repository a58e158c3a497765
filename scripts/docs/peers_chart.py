"""docs/images/peers.png: speed and accuracy beside peers and the bound, from measured figures.

    python -m scripts.docs.peers_chart [FOLDER]

The figures are those of docs/performance/performance.json, which `python -m benchmarks` writes.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl

from quadrotor.checkout import ROOT

MEASURED = ROOT / "docs" / "performance" / "performance.json"
OURS, PEERS, TEXT = "#0f766e", "#8a94a0", "#333a42"
POSES = {
    "quadlab": ("quadlab", (10, 8), "left"),
    "cv2 SQPNP, camera downward": ("OpenCV SQPNP", (-6, 8), "right"),
    "cv2 SQPNP + LM, camera along the bearings' mean": ("SQPNP + LM", (8, 26), "right"),
    "cv2 IPPE, camera downward": ("OpenCV IPPE", (-8, -4), "right"),
    "PoseLib p3p, the fourth chooses": ("PoseLib P3P", (10, -4), "left"),
    "PoseLib p3p + refine, camera along the bearings' mean": ("P3P + refine", (0, 9), "center"),
}
"""Rows of the report of poses: label, its offset from the dot in points, and its alignment."""
FLIGHTS = {
    "RotorPy Environment": "RotorPy",
    "crazyflow, 1024 worlds, symplectic_euler": "crazyflow, 1024 worlds",
    "compiled, sensors and filter": "quadlab, with sensors and filter",
    "C++ -O3, true state": "C++, true state",
    "compiled, true state": "quadlab, true state",
}
"""Rows of the report of flights, in order, and their labels."""


def rows(measured: dict[str, Any], report: str) -> dict[str, dict[str, Any]]:
    """Return the rows of a report by method. Raises KeyError when there is no such report."""
    reports = {one["name"]: one["rows"] for one in measured["reports"]}
    return {row["method"]: row for row in reports[report]}


def words(value: float) -> str:
    """Return a count as people say it."""
    return f"{value / 1e6:.1f} million" if value > 1e5 else f"{value:.0f}"


def draw(measured: dict[str, Any], path: Path) -> None:
    """Draw both panels into a PNG."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    look: dict[Any, Any] = {
        "font.size": 10,
        "text.color": TEXT,
        "axes.labelcolor": TEXT,
        "xtick.color": TEXT,
    }
    with plt.rc_context({**look, "ytick.color": TEXT, "axes.edgecolor": "#b8c0c8"}):
        figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 3.9), layout="constrained")
        poses = rows(measured, "pose")
        for method, (label, offset, side) in POSES.items():
            one, is_ours = poses[method], method == "quadlab"
            at, color = (one["µs"], one["position / bound"]), OURS if is_ours else PEERS
            left.plot(*at, "o", color=color, markersize=9 if is_ours else 7)
            refused = f"\n{one['refused %']:.0f} % refused" if one["refused %"] else ""
            style = {"color": OURS, "weight": "bold"} if is_ours else {"color": TEXT}
            left.annotate(
                label + refused,
                at,
                xytext=offset,
                textcoords="offset points",
                ha=side,
                linespacing=1.1,
                fontsize=9,
                **style,
            )
        left.axhline(1.0, color=TEXT, linewidth=1, linestyle="--")
        left.text(380, 0.93, "Cramér–Rao bound", ha="right", va="top", fontsize=9)
        left.set(xscale="log", yscale="log", xlim=(1, 400), ylim=(0.8, 10))
        left.set_yticks([1, 2, 5, 10], ["1", "2", "5", "10"])
        left.set_yticks([], minor=True)
        left.set_xticks([1, 10, 100], ["1", "10", "100"])
        left.set(xlabel="µs a pose", ylabel="position error / bound")
        left.set_title("Pose from four bearings", loc="left")

        flights = rows(measured, "closed_loop")
        for k, (method, label) in enumerate(FLIGHTS.items()):
            value = flights[method]["a CPU second"]
            right.barh(k, value, color=OURS if "quadlab" in label else PEERS, height=0.62)
            right.text(value * 1.15, k, words(value), va="center")
        right.set_yticks(range(len(FLIGHTS)), list(FLIGHTS.values()))
        right.set(xscale="log", xlim=(100, 3e8), xlabel="steps of 1 ms a CPU second")
        right.set_title("Flight of an 8 in closed loop", loc="left")
        for axes in (left, right):
            axes.spines[["top", "right"]].set_visible(False)
        conditions = measured["conditions"]
        figure.supxlabel(
            f"{conditions['processor']}, {conditions['date']}; all in one run",
            fontsize=8.5,
            x=0.99,
            ha="right",
        )
        figure.savefig(path, dpi=110)
        plt.close(figure)


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images"
    draw(json.loads(MEASURED.read_text(encoding="utf-8")), folder / "peers.png")
