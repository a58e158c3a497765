"""Read a run: `python examples/read_run.py [RUN]`; without RUN it flies a hover and reads that.

RUN is a run of the data folder, the folder of a run, or any log file.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import quadlab
from quadrotor.errors import QuadlabError


def main(run: quadlab.Run) -> None:
    """Print topics, the highest point, the errors against the truth, and the events."""
    print(f"{run.path.stem}: {run.duration:.1f} s, law {run.parameters.get('control.law')}")
    for topic in run.topics:
        print(f"  {topic:20} {len(run[topic]):6} messages, {len(run[topic].columns)} columns")
    if "state" in run:
        height = "pose.pose.position.z"
        state = run["state"]
        print(f"highest point: {state[height].max():.3f} {state.units[height]}")
    if "truth" in run:
        for name, value in run.errors().metrics().items():
            print(f"  {name:28} {value:.4g}")
    for event in run.events:
        print(f"  {event.time:7.2f} s  {event.text}")


if __name__ == "__main__":
    try:
        with TemporaryDirectory() as folder:
            given = sys.argv[1:]
            main(quadlab.open(given[0]) if given else quadlab.fly("hover", out=Path(folder)))
    except QuadlabError as error:
        sys.exit(f"{sys.argv[0]}: {error}")
