"""The same algorithms written by hand in C++17, compiled on demand and run on the same memory."""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import platformdirs

from extensions.batches.onboard import ONBOARD, SETTINGS
from quadrotor.checkout import ROOT
from quadrotor.records import Record
from vehicle.simulator.plant import PLANT

SOURCES = ROOT / "benchmarks" / "cpp"
BUILT = platformdirs.user_cache_path("quadlab") / "twin"
"""Folder of the compiled twins: this user's own, because they are loaded."""
PORTABLE = ("-O3",)
NATIVE = ("-O3", "-march=native")
TUNED = ("-O3", "-fno-math-errno", "-fno-tree-slp-vectorize")
"""The fastest set of flags found for this code with g++ 12."""


class CppTwin:
    """The twin built with some optimisation flags.

    Raises FileNotFoundError without g++, RuntimeError when the records' layouts differ.
    """

    def __init__(self, flags: tuple[str, ...] = PORTABLE) -> None:
        self.flags = flags
        self._library = ctypes.CDLL(str(_built(flags)))
        for name, record in (("onboard", ONBOARD), ("settings", SETTINGS), ("plant", PLANT)):
            size = getattr(self._library, f"size_of_{name}")()
            if size != record.itemsize:
                raise RuntimeError(f"{name} has {size} bytes in C++ and {record.itemsize} here")
        self._library.fly_true_state.restype = ctypes.c_double

    def step(self, onboard: Record, settings: Record, imu: Record, t: float, dt: float) -> None:
        """Run one onboard step in flight, as `compiled_step.onboard_step` does."""
        self._library.onboard_step(
            _of(onboard), _of(settings), _of(imu), ctypes.c_double(t), 1, ctypes.c_double(dt)
        )

    def steps(
        self,
        onboard: Record,
        settings: Record,
        imu: Record,
        thrusts: npt.NDArray[np.float64],
        dt: float,
    ) -> None:
        """Run as `compiled_step.onboard_steps` does."""
        count = ctypes.c_int64(len(imu))
        self._library.onboard_steps(
            _of(onboard), _of(settings), _of(imu), _of(thrusts), 1, ctypes.c_double(dt), count
        )

    def fly_true_state(
        self, settings: Record, plant: Record, onboard: Record, ticks: int, period: float
    ) -> float:
        """Fly a closed loop on the true state, in place; return the rms position error, m."""
        error: float = self._library.fly_true_state(
            _of(settings),
            _of(plant),
            _of(onboard),
            ctypes.c_int64(ticks),
            ctypes.c_double(period),
            round(period / 0.001),
        )
        return error


def _of(array: npt.NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _built(flags: tuple[str, ...]) -> Path:
    compiler = shutil.which("g++")
    if compiler is None:
        raise FileNotFoundError("g++ is not installed: the C++ twin is left out")
    text = b"".join(path.read_bytes() for path in sorted(SOURCES.iterdir()))
    name = hashlib.sha256(text + " ".join(flags).encode()).hexdigest()[:16]
    library = BUILT / f"{name}.so"
    if not library.exists():
        BUILT.mkdir(parents=True, exist_ok=True, mode=0o700)
        part = library.with_suffix(f".{os.getpid()}")  # unique: another process may compile it too
        command = [compiler, "-std=c++17", "-shared", "-fPIC", *flags]
        subprocess.run([*command, str(SOURCES / "twin.cpp"), "-o", str(part)], check=True)
        part.replace(library)
    return library
