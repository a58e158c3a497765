"""A signal ends a loop, whatever the loop is doing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from vehicle_link.termination_signal import EndSignal

WAITS = """
from vehicle_link.termination_signal import EndSignal
ending = EndSignal()
print("up", flush=True)
while not ending.wait(0.0):  # all its time within `wait`
    pass
print("ended")
"""


def test_a_signal_is_seen_at_once_and_stays() -> None:
    before = signal.getsignal(signal.SIGUSR1)
    try:
        ending = EndSignal([signal.SIGUSR1])
        assert not ending.wait(0.0)
        for _ in range(1000):  # more than its socket can hold
            os.kill(os.getpid(), signal.SIGUSR1)
        began = time.monotonic()
        assert ending.wait(60.0)
        assert ending.wait(60.0)
        assert time.monotonic() - began < 30.0
    finally:
        signal.signal(signal.SIGUSR1, before)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_loop_that_only_waits_ends_whenever_the_signal_comes(number: signal.Signals) -> None:
    """A threading.Event made it hang at about every second try."""
    for _ in range(5):
        child = subprocess.Popen([sys.executable, "-c", WAITS], stdout=subprocess.PIPE, text=True)
        assert child.stdout is not None
        assert child.stdout.readline() == "up\n"
        child.send_signal(number)
        try:
            said, _ = child.communicate(timeout=30.0)
        finally:
            child.kill()
        assert (said, child.returncode) == ("ended\n", 0)


def test_with_nohup_a_terminal_that_is_closed_ends_nothing() -> None:
    program = f"""
import os, signal
signal.signal(signal.SIGHUP, signal.SIG_IGN)
{WAITS.replace("while", "os.kill(os.getpid(), signal.SIGHUP)" + chr(10) + "while")}"""
    child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "up\n"
    assert child.poll() is None
    child.terminate()
    assert child.communicate(timeout=30.0)[0] == "ended\n"
