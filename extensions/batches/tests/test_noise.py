"""Random numbers of the compiled loops: known words, moments, tails, independence."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from extensions.batches.noise import EDGES, LAYERS, TAIL, normals, seeded, uniform, word

MASK = (1 << 64) - 1


def drawn(seed: int, count: int) -> np.ndarray:
    out = np.empty(count)
    normals(seeded([seed])[0], out)
    return out


@pytest.fixture(scope="module")
def stats() -> Any:
    """Return scipy.stats, imported only by the process that needs it, not by all that collect."""
    from scipy import stats

    return stats


def test_words_are_those_of_xoshiro256pp() -> None:
    def rotated(x: int, k: int) -> int:
        return ((x << k) | (x >> (64 - k))) & MASK

    generator = seeded([42])[0]
    s = [int(x) for x in generator]
    for _ in range(1000):
        expected = (rotated((s[0] + s[3]) & MASK, 23) + s[0]) & MASK
        t = (s[1] << 17) & MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = rotated(s[3], 45)
        assert int(word(generator)) == expected
        assert [int(x) for x in generator] == s


def test_seed_0_gives_the_published_splitmix64() -> None:
    # The first outputs of Vigna's reference splitmix64.c for the state 0.
    assert [hex(int(x)) for x in seeded([0])[0][:3]] == [
        "0xe220a8397b1dcdaf",
        "0x6e789e6aa1b965f4",
        "0x6c45d188009454f",
    ]


def test_layers_have_one_area() -> None:
    density = np.exp(-0.5 * EDGES[1:] ** 2)
    density[-1] = 1.0
    areas = EDGES[1:LAYERS] * np.diff(density)
    assert areas == pytest.approx(areas[0], rel=1e-9)
    tail = math.sqrt(math.pi / 2) * math.erfc(TAIL / math.sqrt(2))
    assert TAIL * density[0] + tail == pytest.approx(areas[0], rel=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_normal_numbers_have_the_moments_of_a_normal_distribution(seed: int, stats: Any) -> None:
    print("seed", seed)
    n = 1_000_000
    x = drawn(seed, n)
    # Five standard errors of each estimate.
    for power, moment, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96), (6, 15, 10170)):
        assert (x**power).mean() == pytest.approx(moment, abs=5 * math.sqrt(variance / n))
    assert stats.kstest(x, "norm").pvalue > 1e-4
    beyond = (np.abs(x) > TAIL).sum()
    expected = n * 2 * stats.norm.sf(TAIL)
    assert beyond == pytest.approx(expected, abs=5 * math.sqrt(expected))
    assert np.abs(np.corrcoef(x[:-1], x[1:])[0, 1]) < 5 / math.sqrt(n)


def test_neighbouring_seeds_are_not_alike() -> None:
    x = np.array([drawn(seed, 20_000) for seed in range(20)])
    correlation = np.corrcoef(x) - np.eye(20)
    assert np.abs(correlation).max() < 5 / math.sqrt(20_000)


def test_uniform_numbers_fill_0_to_1(stats: Any) -> None:
    generator = seeded([7])[0]
    x = np.array([uniform(generator) for _ in range(20_000)])
    assert 0.0 <= x.min() < 1e-3
    assert 1.0 - 1e-3 < x.max() < 1.0
    assert stats.kstest(x, "uniform").pvalue > 1e-4


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others() -> None:
    assert (drawn(5, 1000) == drawn(5, 1000)).all()
    assert (drawn(5, 1000) != drawn(6, 1000)).all()
    assert (drawn(-1, 10) == drawn((1 << 64) - 1, 10)).all()  # any integer is a seed
