"""The example law in Octave answers over UDP what the example law in Python does."""

from __future__ import annotations

import socket
import subprocess
from collections.abc import Iterator

import numpy as np
import pytest

from quadrotor.checkout import ROOT
from quadrotor.records import Record
from vehicle.laws.contract import INPUT_TYPE, OUTPUT_TYPE, hovering, load, step
from vehicle.plugins.contract import as_attributes

pytestmark = pytest.mark.needs("octave")
EXAMPLES = ROOT / "examples" / "laws"
MOVED = ("position_w", "velocity_w", "angular_velocity_b", "reference_jerk_w")


@pytest.fixture
def octave() -> Iterator[socket.socket]:
    """Start the script; yield a socket to it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours:
        ours.bind(("127.0.0.1", 0))
        ours.settimeout(20.0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            theirs = free.getsockname()
        words = ["octave-cli", "--quiet", str(EXAMPLES / "geometric_udp.m")]
        ports = [str(theirs[1]), str(ours.getsockname()[1])]
        with subprocess.Popen([*words, *ports], stdout=subprocess.PIPE, text=True) as peer:
            assert peer.stdout is not None
            assert "ready" in peer.stdout.readline()
            ours.connect(theirs)
            yield ours
            peer.kill()


def an_input(number: int, random: np.random.Generator) -> Record:
    x, at = np.zeros(1, INPUT_TYPE), hovering()
    for name in INPUT_TYPE.names or ():
        x[name] = getattr(at, name)
    x["time"], x["reset"], x["flying"] = 0.002 * number, number == 0, number > 2
    for name in MOVED:
        x[name] += random.normal(0.0, 0.1, 3)
    quaternion = np.array([1.0, 0.1, -0.05, 0.2]) + random.normal(0.0, 0.02, 4)
    x["quaternion_wb"] = quaternion / np.linalg.norm(quaternion)
    x["reference_yaw"], x["reference_yaw_rate"] = 0.3, 0.2
    return x


def test_the_script_answers_the_numbers_of_the_example_in_python(octave: socket.socket) -> None:
    law, random = load(EXAMPLES / "geometric_pid.py"), np.random.default_rng(24)
    for number in range(50):
        x, expected = an_input(number, random), np.zeros(1, OUTPUT_TYPE)
        octave.send(x.tobytes())
        step(law, as_attributes(x), expected)
        answer = np.frombuffer(octave.recv(1024), OUTPUT_TYPE)
        assert answer["time"] == x["time"]
        assert answer["thrust"] == pytest.approx(expected["thrust"], abs=1e-12)
        assert answer["torque_b"] == pytest.approx(expected["torque_b"], abs=1e-12)
