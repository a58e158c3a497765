"""MAVSDK, unchanged, flies the laboratory's vehicle through the MAVLink gateway."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flight_log.run_folder import log_of
from quadrotor.checkout import ROOT
from tests.system.conftest import free_ports

pytestmark = pytest.mark.timeout(180)


def test_mavsdk_flies_a_circle_and_downloads_the_run(
    lab: Any, until: Callable[..., Any], tmp_path: Path
) -> None:
    lab.ready()
    (port,) = free_ports(1)
    log = tmp_path / "run.mcap"
    words = ["--data", str(lab.data), "--loopback-port", str(lab.link_port)]
    gateway = subprocess.Popen(
        [sys.executable, "-m", "quadlab", "mavlink", f"udpin:127.0.0.1:{port}", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        flight = subprocess.run(
            [sys.executable, ROOT / "examples/mavsdk_circle.py", f"udpout://127.0.0.1:{port}", log],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    finally:
        gateway.terminate()
        said, _ = gateway.communicate(timeout=20)
    assert flight.returncode == 0, f"{flight.stdout}\n{flight.stderr}\n{said}"
    assert gateway.returncode == 0, said
    farthest = re.search(r"circle flown, up to ([\d.]+) m away", flight.stdout)
    assert farthest is not None, flight.stdout
    assert 0.6 < float(farthest[1]) < 0.9
    assert "mavlink 245 at 127.0.0.1" in said
    until("control to be free", lambda: lab.summary()["control"]["holder"] == "", 15)
    run = lab.newest("runs")
    assert log.read_bytes()[:8] == b"\x89MCAP0\r\n"
    assert log.stat().st_size == log_of(run).stat().st_size
