"""Large buffers go back to the machine, in a process of their own: the setting is a process's."""

from __future__ import annotations

import ctypes
import subprocess
import sys

import pytest

HOLDS = """
import ctypes, mmap, pathlib, sys
from vehicle_link.heap import keep_large_buffers_apart

library = ctypes.CDLL(None)
library.malloc.restype = ctypes.c_void_p
library.malloc.argtypes = [ctypes.c_size_t]
library.free.argtypes = [ctypes.c_void_p]
SIZE, COUNT = 3 << 20, 9

def resident():
    return mmap.PAGESIZE * int(pathlib.Path("/proc/self/statm").read_text().split()[1])

def touched():
    address = library.malloc(SIZE)
    ctypes.memset(address, 1, SIZE)
    return address

if sys.argv[1] == "apart":
    assert keep_large_buffers_apart()
library.free(touched())  # glibc takes buffers of this size from its heap from now on
before = resident()
freed = [touched() for _ in range(COUNT)]
above = touched()
for address in freed:
    library.free(address)
print((resident() - before) / SIZE)
"""


@pytest.mark.skipif(
    not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"), reason="not the GNU C library"
)
@pytest.mark.parametrize(("setting", "kept"), [("apart", 1.0), ("plain", 10.0)])
def test_freed_buffers_leave_the_process(setting: str, kept: float) -> None:
    """Of ten, nine freed; the plain case shows what the setting is for."""
    done = subprocess.run(
        [sys.executable, "-c", HOLDS, setting], check=True, stdout=subprocess.PIPE, text=True,
        timeout=60,
    )  # fmt: skip
    assert float(done.stdout) == pytest.approx(kept, abs=0.5)
