"""Two campaigns, flight by flight: is the second one worse than noise explains?

Flights with the same seed and factors are pairs. Of the metrics that have limits (the smaller the
better), the differences are tested by Wilcoxon's signed-rank test; of the verdicts, the pairs of
which one flight passed by McNemar's exact test. Both are one-sided, for worse and for better, and
the level is divided by the number of tests (Bonferroni).
"""

from __future__ import annotations

import contextlib
import warnings
from typing import TYPE_CHECKING

import numpy as np

from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.summary import Numbers, quantile_interval
from extensions.campaigns.table import Facts, is_verdict, judged_metrics, numbers
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    import pyarrow as pa

LEVEL = 0.05
"""Probability of calling one of two equal campaigns worse."""


def compare(one: CampaignFolder, other: CampaignFolder) -> Facts:
    """Return the paired differences, second minus first. Raises UsageError without pairs."""
    a, b = (folder.table(figures_only=True) for folder in (one, other))
    first, second = _paired(one, other, a, b)
    pairs = len(first)
    tests = {"passed": _verdicts(is_verdict(a, "passed")[first], is_verdict(b, "passed")[second])}
    for name in sorted({*judged_metrics(a)} & {*judged_metrics(b)}):
        tests[name] = _metric(numbers(a, name)[first], numbers(b, name)[second])
    level = LEVEL / len(tests)
    for found in tests.values():
        found["is_worse"] = found["p"] < level
        found["is_better"] = found["p_better"] < level
    return {
        "pairs": pairs,
        "unpaired": [one.count() - pairs, other.count() - pairs],
        "level": level,
        "tests": tests,
        "is_worse": any(found["is_worse"] for found in tests.values()),
    }


def _paired(
    one: CampaignFolder, other: CampaignFolder, a: pa.Table, b: pa.Table
) -> tuple[Numbers, Numbers]:
    """Return the places of the rows with the same seed and factors."""
    import pyarrow as pa

    mine, theirs = one.plan.plan, other.plan.plan
    if mine.varied != theirs.varied:
        raise UsageError(
            f"{one.path} has the factors {', '.join(mine.varied) or '(none)'}, {other.path} has "
            f"{', '.join(theirs.varied) or '(none)'}: only flights with equal factors are pairs"
        )
    keys = ["seed", *mine.varied]
    sides = [
        pa.table({**{key: table[key] for key in keys}, side: np.arange(table.num_rows)})
        for side, table in (("first", a), ("second", b))
    ]
    found = np.empty((2, 0), int)
    with contextlib.suppress(pa.ArrowTypeError):  # words are never equal to numbers
        rows = pa.concat_tables(sides, promote_options="permissive").group_by(keys)
        groups = rows.aggregate([("first", "max"), ("second", "max")])
        found = np.array([numbers(groups, "first_max"), numbers(groups, "second_max")])
        found = found[:, np.isfinite(found).all(axis=0)].astype(int)
    if not found.size:
        raise UsageError(
            f"{one.path} and {other.path} have no flights with the same seed and factors: fly both "
            "from plans with the same seed, seeds and factors"
        )
    return found[0], found[1]


def _verdicts(was: Numbers, now: Numbers) -> Facts:
    from scipy.stats import binomtest

    worse, better = int((was & ~now).sum()), int((~was & now).sum())
    changed = worse + better
    p, p_better = (
        float(binomtest(count, changed, 0.5, "greater").pvalue) if changed else 1.0
        for count in (worse, better)
    )
    return {
        "test": "McNemar, exact",
        "first": int(was.sum()),
        "second": int(now.sum()),
        "worse": worse,
        "better": better,
        "p": p,
        "p_better": p_better,
    }


def _metric(a: Numbers, b: Numbers) -> Facts:
    from scipy.stats import wilcoxon

    both = np.isfinite(a) & np.isfinite(b)
    difference = np.sort(b[both] - a[both])
    p = p_better = 1.0
    if np.any(difference):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of few pairs: p is then exact, or large
            p, p_better = (
                float(wilcoxon(difference, alternative=side).pvalue) for side in ("greater", "less")
            )
    low, high = quantile_interval(difference, 0.5) if len(difference) else (0.0, 0.0)
    return {
        "test": "Wilcoxon signed-rank",
        "pairs": int(both.sum()),
        "first": float(np.median(a[both])) if both.any() else None,
        "second": float(np.median(b[both])) if both.any() else None,
        "difference": float(np.median(difference)) if both.any() else None,
        "low": float(low) if len(difference) else None,
        "high": float(high) if len(difference) else None,
        "p": p,
        "p_better": p_better,
    }


def told(found: Facts) -> list[str]:
    """Return a comparison as lines of text."""
    lines = [f"{found['pairs']} pairs of flights; worse is what has p below {found['level']:.2g}"]
    if any(found["unpaired"]):
        lines.append("without a pair: {} of the first, {} of the second".format(*found["unpaired"]))
    for name, one in found["tests"].items():
        if name == "passed":
            what = (
                f"{one['first']} and {one['second']}; {one['worse']} worse, {one['better']} better"
            )
        elif one["difference"] is None:
            what = "in no pair"
        else:
            what = (
                f"{one['first']:.5g} and {one['second']:.5g}; difference {one['difference']:+.3g} "
                f"(95 %: {one['low']:+.3g} to {one['high']:+.3g})"
            )
        sign = "WORSE" if one["is_worse"] else "better" if one["is_better"] else "not worse"
        lines.append(f"  {name:18} {sign:9}  {what}; p = {one['p']:.2g} ({one['test']})")
    return lines
