"""Fly an experiment on a running laboratory: `python examples/live_client.py LINK [EXPERIMENT]`.

LINK is a sign-in link, which `quadlab up` prints.
"""

from __future__ import annotations

import sys

import quadlab
from quadrotor.errors import QuadlabError


def main(link: str, experiment: str) -> None:
    """Print the battery voltage before the flight, then the verdict and the metrics."""
    with quadlab.connect(link) as lab:
        sample = next(lab.stream("battery.voltage"))
        print(f"{lab.label}: battery {sample['battery.voltage']:.1f} V, flying {experiment} …")
        run = lab.fly(experiment)
    assert run.result is not None
    print(f"{run.path.stem}: {run.result.verdict}")
    for name, value in run.result.metrics.items():
        print(f"  {name:32} {value:.4g}")


if __name__ == "__main__":
    try:
        main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "hover")
    except IndexError:
        sys.exit(f"{sys.argv[0]} needs a sign-in link, which `quadlab up` prints")
    except QuadlabError as error:
        sys.exit(f"{sys.argv[0]}: {error}")
