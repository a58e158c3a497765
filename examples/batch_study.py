"""Fly hundreds of flights at once, and draw how error grows with a side force:
`python examples/batch_study.py [FLIGHTS] [PICTURE]`.
"""

from __future__ import annotations

import sys

import matplotlib as mpl
import numpy as np

from vehicle.closed_loop.batch import Scenario, fly_batch

FORCES = (0.0, 0.5, 1.0, 1.5, 2.0)  # N, to the left
HOVER, LAP = 8.0, 8.0  # s


def main(flights: int, picture: str) -> None:
    """Fly the paper's 8 under each force over many seeds; print medians, draw quartiles."""
    mpl.use("agg")
    from matplotlib import pyplot as plt

    scenarios = [
        Scenario(seed=seed, disturbance_w=(0.0, force, 0.0))
        for force in FORCES
        for seed in range(flights)
    ]
    result = fly_batch(scenarios, duration=HOVER + LAP, hover=HOVER)
    errors = 1e3 * result.outcome["position_rms"].reshape(len(FORCES), flights)  # mm
    low, middle, high = np.percentile(errors, [25, 50, 75], axis=1)
    for force, median in zip(FORCES, middle, strict=True):
        print(f"{force:.1f} N: {median:.2f} mm rms")
    print(result.summary())
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    axes.fill_between(FORCES, low, high, alpha=0.3, label="quartiles")
    axes.plot(FORCES, middle, "o-", label="median")
    axes.set(xlabel="side force [N]", ylabel="position error [mm rms]", ylim=(0, None))
    axes.legend()
    figure.savefig(picture)
    print(picture)


if __name__ == "__main__":
    words = sys.argv[1:]
    main(int(words[0]) if words else 100, words[1] if len(words) > 1 else "batch_study.png")
