"""Freed memory is returned to the machine, tested in separate processes."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAP = """
import ctypes, mmap, pathlib, sys

library = ctypes.CDLL(None)
library.malloc.restype = ctypes.c_void_p
library.malloc.argtypes = [ctypes.c_size_t]
library.free.argtypes = [ctypes.c_void_p]

def resident():
    return mmap.PAGESIZE * int(pathlib.Path("/proc/self/statm").read_text().split()[1])

def touched(size):
    address = library.malloc(size)
    ctypes.memset(address, 1, size)
    return address
"""

LARGE = """
from vehicle_link.transport.unused_memory import map_large_buffers
SIZE, COUNT = 3 << 20, 9

if sys.argv[1] == "apart":
    assert map_large_buffers()
library.free(touched(SIZE))  # glibc takes buffers of this size from its heap from now on
before = resident()
freed = [touched(SIZE) for _ in range(COUNT)]
above = touched(SIZE)
for address in freed:
    library.free(address)
print((resident() - before) / SIZE)
"""

SMALL = """
from vehicle_link.transport.unused_memory import trim_heaps
SIZE, COUNT = 10_000, 3_000

before = resident()
freed = [touched(SIZE) for _ in range(COUNT)]
above = touched(SIZE)  # the heap ends behind it, so all before it stays
for address in freed:
    library.free(address)
print((resident() - before) / (SIZE * COUNT))
assert trim_heaps()
print((resident() - before) / (SIZE * COUNT))
"""


def printed(program: str, *arguments: str) -> list[float]:
    done = subprocess.run(
        [sys.executable, "-c", HEAP + program, *arguments],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        timeout=60,
    )
    return [float(line) for line in done.stdout.split()]


@pytest.mark.parametrize(("setting", "kept"), [("apart", 1.0), ("plain", 10.0)])
def test_freed_buffers_leave_the_process(setting: str, kept: float) -> None:
    """Nine of ten buffers are freed; the plain case shows the purpose of the setting."""
    assert printed(LARGE, setting) == pytest.approx([kept], abs=0.5)


def test_free_pages_inside_the_heap_leave_the_process() -> None:
    kept, given_back = printed(SMALL)
    assert kept > 0.9
    assert given_back < 0.1
