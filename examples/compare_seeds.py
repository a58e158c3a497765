"""Compare two gain sets over some seeds of one flight: `python examples/compare_seeds.py`."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import quadlab

PRESETS = ("standard", "stiff")


def main(seeds: int) -> None:
    """Print the position error and tilt of each gain set, as medians over the seeds."""
    with TemporaryDirectory() as folder:
        for preset in PRESETS:
            errors, tilts = [], []
            for seed in range(1, seeds + 1):
                run = quadlab.fly(
                    "hover", seed=seed, set={"control.preset": preset}, out=Path(folder)
                )
                assert run.result is not None
                errors.append(run.result.metrics["position_rms_m"])
                state = run["state"].window(0.5 * run.duration, run.duration)
                x, y = state.numpy(
                    "pose.pose.orientation.x", "pose.pose.orientation.y"
                ).T  # half the tilt, if the vehicle is nearly level
                tilts.append(np.degrees(2.0 * np.sqrt(np.mean(x**2 + y**2))))
            print(
                f"{preset:10} error {1e3 * np.median(errors):.2f} mm rms, "
                f"tilt {np.median(tilts):.2f} deg rms"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
