"""Random seeds from the test's name."""

from __future__ import annotations

import zlib

import numpy as np
import pytest


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    found = zlib.crc32(request.node.name.encode()) & 0x7FFF_FFFF
    print(f"seed {found} from {request.node.name}")
    return found


@pytest.fixture
def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)
