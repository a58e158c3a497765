"""MAVSDK's own client, unchanged, understands the gateway."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

from extensions.mavlink.tests.wired import IdealStation, Wired
from quadrotor.checkout import ROOT

PATIENCE = 60.0


def test_the_example_flies_a_circle_and_downloads_a_run(tmp_path: Path) -> None:
    wired = Wired(tmp_path, station=IdealStation())
    contents, copy = os.urandom(100_000), tmp_path / "copy.mcap"
    file = tmp_path / "run.mcap"
    file.write_bytes(contents)
    run = SimpleNamespace(id="run", complete=True, start_ns=10**18)
    wired.logs._catalogue = SimpleNamespace(  # type: ignore[assignment]
        runs=lambda **_: [run], resolve=lambda _: file
    )
    script = ROOT / "examples/mavsdk_circle.py"
    flight = subprocess.Popen(
        [sys.executable, script, f"udpout://127.0.0.1:{wired.port}", copy],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    end = time.monotonic() + PATIENCE
    while flight.poll() is None and time.monotonic() < end:
        wired.gateway.turn(0.02)
    flight.kill()
    said, _ = flight.communicate()
    wired.close()
    assert flight.returncode == 0, f"{said}\n{wired.lines}"
    assert "position gain 4" in said
    farthest = re.search(r"circle flown, up to ([\d.]+) m away", said)
    assert farthest is not None, said
    assert 0.6 < float(farthest[1]) < 0.9, f"the references follow the set-points: {said}"
    assert copy.read_bytes() == contents
    asked = [(service, fields.get("name", "")) for _, service, fields in wired.station.asked]
    assert asked == [
        ("arm", ""),
        *(("start_behavior", name) for name in ("take_off", "external", "hover", "land")),
    ]
