"""crazyflow's batched closed loop in JAX on the processor, single precision.

It runs in a separate process, as it needs a setting of scipy's that must precede every import.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

from quadrotor.checkout import ROOT

WORLDS = 1024


class Crazyflow:
    """State control at 500 Hz around first-principles dynamics at 1 kHz, holding a point.

    Args:
        integrator: "rk4" or "symplectic_euler".

    Raises ImportError when it is not installed or does not start.
    """

    def __init__(self, integrator: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "benchmarks.peers.crazyflow_flight", integrator],
            cwd=tempfile.gettempdir(),  # MuJoCo writes a log to its working directory
            env={
                **os.environ,
                "PYTHONPATH": str(ROOT),
                "SCIPY_ARRAY_API": "1",
                "JAX_PLATFORMS": "cpu",
            },
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        answer = self._answer()
        while answer not in ("ready", ""):  # skip output of its dependencies at their start
            answer = self._answer()
        if answer == "":
            error = self._process.communicate()[1].strip().splitlines()
            raise ImportError(error[-1] if error else "its process ended")

    def fly(self, steps: int) -> tuple[int, float]:
        """Step all worlds by `steps` of 1 ms; return all steps and seconds of processor time."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{steps}\n")
        self._process.stdin.flush()
        return steps * WORLDS, float(self._answer())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        return line.strip() or ("" if line == "" else "-")


def serve(integrator: str) -> None:
    """Fly the number of steps in each line of the input; answer with the processor time."""
    import jax
    import numpy as np
    from crazyflow.control import Control
    from crazyflow.sim import Sim
    from crazyflow.sim.integration import Integrator
    from crazyflow.sim.sim import Dynamics

    sim = Sim(
        n_worlds=WORLDS,
        freq=1000,
        state_freq=500,
        attitude_freq=500,
        body_rate_freq=500,
        force_torque_freq=500,
        dynamics=Dynamics.first_principles,
        control=Control.state,
        integrator=Integrator(integrator),
    )
    sim.reset()
    command = np.zeros((WORLDS, 1, 16), np.float32)
    command[..., 2] = 0.5
    command[..., 12] = 1.0  # quaternion (x, y, z, w)
    print("ready", flush=True)
    for line in sys.stdin:
        began = time.process_time()
        sim.state_control(command)
        sim.step(int(line))
        jax.block_until_ready(sim.data.states.pos)
        busy = time.process_time() - began
        if not np.isfinite(np.asarray(sim.data.states.pos)).all():
            raise RuntimeError("crazyflow's state is not finite: its figure would mean nothing")
        print(busy, flush=True)


if __name__ == "__main__":
    serve(sys.argv[1])
