"""`quadlab up` from start to a flown 8 with one page open: times, load, memory, bytes a second.

Run: .venv/bin/python -m benchmarks.page.laboratory [--cold]     (--cold: without compiled code)

The page is replaced by a client that opens the same three websockets as the browser's page, so the
figures are of quadlab's processes alone, not of a browser's rendering.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from quadrotor.checkout import ROOT

GAIN = "control.position.kp_xy"
TICK = os.sysconf("SC_CLK_TCK")
LIMITS = {
    "page_s": (15.0, 6.0),
    "vehicle_s": (15.0, 6.0),
    "cpu_percent": 150.0,
    "memory_mb": 1200.0,
    "slider_p95_ms": 150.0,
    "telemetry_kB_s": 5.0,
    "viser_kB_s": 100.0,
}


@contextmanager
def started(
    port: int, link_port: int, *words: str, tree: Path = ROOT, lockstep: bool = False
) -> Iterator[tuple[int, list[str]]]:
    """Yield the process of a checkout's `quadlab up` with temporary data, and its growing output.

    It runs in real time unless `lockstep`, as simulated time would wait for what is measured.
    """
    with tempfile.TemporaryDirectory(prefix="quadlab-benchmark-") as data:
        up = subprocess.Popen(
            [
                sys.executable if tree == ROOT else tree / ".venv" / "bin" / "python",
                "-m",
                "quadlab",
                "up",
                "--no-browser",
                *(() if lockstep else ("--real-time",)),
                "--data",
                data,
                "--port",
                str(port),
                "--link-port",
                str(link_port),
                *words,
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=tree,
        )
        assert up.stdout is not None
        reader, lines = up.stdout, list[str]()
        threading.Thread(
            target=lambda: lines.extend(iter(reader.readline, "")), daemon=True
        ).start()
        try:
            yield up.pid, lines
        finally:
            up.send_signal(signal.SIGINT)
            up.wait(60.0)


class Socket:
    """One websocket of the page, which counts what it receives."""

    def __init__(self, url: str, cookie: str, first: str | None = None, **options: Any) -> None:
        self.bytes = 0
        self.messages: list[str | bytes] = []
        self._socket = connect(
            url,
            additional_headers={"Cookie": cookie},
            origin=_origin(url),
            max_size=None,
            compression=None,
            **options,
        )
        if first:
            self._socket.send(first)
        threading.Thread(target=self._read, daemon=True).start()

    def close(self) -> None:
        self._socket.close()

    def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for message in self._socket:
                self.bytes += len(message)
                self.messages.append(message)


def _origin(url: str) -> Any:
    return re.sub(r"^ws(://[^/]+).*", r"http\1", url)


def processes(parent: int) -> dict[int, str]:
    """Return `parent` and all its descendants by process id, with a short name."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            parents[int(entry.name)] = int(fields[1])
    family = {parent}
    while more := {pid for pid, of in parents.items() if of in family} - family:
        family |= more
    found = {}
    for pid in family:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
        found[pid] = words[3] if words[2] == "quadlab" else words[2]
    return found


def cpu_seconds(pids: dict[int, str]) -> dict[str, float]:
    """Return processor seconds, including those of children that have ended."""
    out = {}
    for pid, name in pids.items():
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        out[name] = sum(map(int, fields[11:15])) / TICK
    return out


def threads(pids: dict[int, str]) -> dict[str, float]:
    return {name: len(list(Path(f"/proc/{pid}/task").iterdir())) for pid, name in pids.items()}


def memory_mb(pids: dict[int, str]) -> dict[str, float]:
    """Return the proportional set size: shared pages are counted once over all processes."""
    out = {}
    for pid, name in pids.items():
        text = Path(f"/proc/{pid}/smaps_rollup").read_text()
        kilobytes = re.search(r"^Pss:\s+(\d+)", text, re.MULTILINE)
        out[name] = int(kilobytes[1]) / 1000 if kilobytes else 0.0
    return out


def until(look: Any, patience: float = 60.0, every: float = 0.02) -> Any:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        found = look()
        if found:
            return found
        time.sleep(every)
    raise SystemExit(f"waited {patience:.0f} s in vain")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cold", action="store_true", help="compile everything again")
    parser.add_argument("--port", type=int, default=28080)
    parser.add_argument("--link-port", type=int, default=28447)
    options = parser.parse_args()
    if options.cold:
        shutil.rmtree(ROOT / "__pycache__" / "kernels", ignore_errors=True)
    began = time.monotonic()
    with started(options.port, options.link_port) as (up, lines):
        report = measure(up, lines, began, options.cold)
    for name, value in report.items():
        limit = LIMITS.get(name)
        if isinstance(limit, tuple):
            limit = limit[0 if options.cold else 1]
        bound = f"   limit {limit:g}" if limit else ""
        print(f"{name:24} {value if isinstance(value, str) else format(value, '10.3f')}{bound}")


def measure(parent: int, lines: list[str], began: float, cold: bool) -> dict[str, Any]:
    report: dict[str, Any] = {"start": "first, compiling" if cold else "second"}
    link = until(lambda: re.findall(r"http://\S+", "".join(lines)))[-1]
    base = link.split("/?")[0]
    browser = httpx.Client(base_url=base, headers={"origin": base}, timeout=10)
    assert browser.get(link, follow_redirects=True).status_code == 200
    report["page_s"] = time.monotonic() - began

    def summary() -> dict[str, Any]:
        found: dict[str, Any] = browser.get("/api/summary").json()
        return found

    def status() -> dict[str, Any]:
        return summary().get("status") or {}

    until(status)
    report["vehicle_s"] = time.monotonic() - began
    until(lambda: status().get("mode") == "ready")
    report["ready_s"] = time.monotonic() - began

    cookie = "; ".join(f"{c.name}={c.value}" for c in browser.cookies.jar)
    web = base.replace("http", "ws")
    names = [s["name"] for s in browser.get("/api/signals").json()["signals"]][:40]
    telemetry = Socket(f"{web}/ws/telemetry", cookie, json.dumps({"id": 1, "signals": names}))
    events = Socket(f"{web}/ws/events", cookie)
    viser = Socket(f"{web}/viser?view=benchmark", cookie, subprotocols=[viser_protocol()])

    def command(command: str, /, **body: Any) -> None:
        answer = browser.post(f"/api/commands/{command}", json=body)
        assert answer.status_code == 200, answer.text

    until(lambda: (summary().get("preflight") or {}).get("ready"))
    command("arm")
    until(lambda: status()["mode"] == "armed")
    time.sleep(1.0)
    command("start_behavior", name="take_off")
    until(lambda: status()["behavior"] == "hover")
    command("start_behavior", name="follow_trajectory", arguments={"laps": 3})

    pids = processes(parent)
    spent, since = cpu_seconds(pids), time.monotonic()
    counted = [socket.bytes for socket in (telemetry, events, viser)]
    lateness = []
    for _ in range(15):
        time.sleep(1.0)
        lateness.append(status())
    elapsed = time.monotonic() - since
    now = cpu_seconds(pids)
    shares = {name: 100 * (now[name] - spent[name]) / elapsed for name in now}
    for name, share in sorted(shares.items()):
        report[f"  cpu {name}"] = share
    report["cpu_percent"] = sum(shares.values())
    memory = memory_mb(pids)
    for name, size in sorted(memory.items()):
        report[f"  memory {name}"] = size
    report["memory_mb"] = sum(memory.values())
    rates = [
        (socket.bytes - before) / elapsed / 1000
        for socket, before in zip((telemetry, events, viser), counted, strict=True)
    ]
    report["telemetry_kB_s"], report["events_kB_s"], report["viser_kB_s"] = rates
    for key, unit in (("lateness_p50", 1e3), ("lateness_p99", 1e3), ("missed_share", 100)):
        values = [s[key] * unit for s in lateness]
        report[f"{key}_{'percent' if unit == 100 else 'ms'}"] = statistics.median(values)
    report["tick_rate_hz"] = statistics.median(s["tick_rate"] for s in lateness)

    delays = []
    for k in range(60):
        value, start = 4.0 + 0.01 * (k % 7 + 1), time.monotonic()
        answer = browser.put("/api/parameters", json={"values": {GAIN: value}})
        assert answer.status_code == 200, answer.text
        # Confirmed on every page: the vehicle's own change arrives on the events socket.
        until(lambda v=value: _confirmed(events, v), 5.0)
        delays.append(1e3 * (time.monotonic() - start))
    report["slider_p50_ms"] = float(np.percentile(delays, 50))
    report["slider_p95_ms"] = float(np.percentile(delays, 95))
    until(lambda: status()["behavior"] == "hover")
    command("start_behavior", name="land")
    until(lambda: not status()["armed"])
    return report


def _confirmed(events: Socket, value: float) -> bool:
    texts = [m for m in events.messages[-20:] if isinstance(m, str) and GAIN in m]
    return any(f"{value:g}" in text for text in texts)


def viser_protocol() -> Any:
    import viser

    return f"viser-v{viser.__version__}"


if __name__ == "__main__":
    main()
