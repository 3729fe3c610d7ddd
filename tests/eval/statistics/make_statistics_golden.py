#!/usr/bin/env python3
"""Writes statistics_golden.json: what NumPy and SciPy compute of the score tables of statistics_golden_test.cc.

Needs python3-numpy and python3-scipy (Debian); the C++ test does not.

    tests/eval/statistics/make_statistics_golden.py > tests/eval/statistics/statistics_golden.json

Exact quantities are compared to 1e-9. An interval of the bootstrap differs from run to run: it is computed RUNS times with as many
resamples as the C++ test draws, and its ends are given as their mean and a tolerance, which is five standard deviations of the
difference between that mean and one more run. For an end that moves in steps, the tolerance is at least the step.
"""

import json
import platform

import numpy as np
import scipy
from scipy import optimize, stats

RUNS = 40
SAMPLES = 2000


def iqm(scores):
    return stats.trim_mean(np.asarray(scores).ravel(), 0.25)


def improvement(x, y):
    """[seed, course] each."""
    return np.mean([stats.mannwhitneyu(x[:, c], y[:, c]).statistic / (len(x) * len(y)) for c in range(x.shape[1])])


def fast_improvement(x, y):
    """The same without SciPy, for the bootstrap."""
    return np.mean((x[:, None, :] > y[None, :, :]) + 0.5 * (x[:, None, :] == y[None, :, :]))


def interval_once(tables, statistic, limits, rng):
    """The interval of docs/statistics.md. `tables` share their courses; `statistic` takes as many tables."""
    num_courses = tables[0].shape[1]
    value = statistic(*tables)
    factors = []  # (variance, levels) by leaving one out
    if num_courses > 1:
        left = [statistic(*[np.delete(t, c, axis=1) for t in tables]) for c in range(num_courses)]
        factors.append((left, num_courses))
    for k, table in enumerate(tables):
        if len(table) > 1:
            left = [statistic(*[np.delete(t, s, axis=0) if i == k else t for i, t in enumerate(tables)])
                    for s in range(len(table))]
            factors.append((left, len(table)))
    variances = np.array([(n - 1) / n * np.sum((np.array(left) - np.mean(left)) ** 2) for left, n in factors])
    sizes = np.array([n for _, n in factors])
    df = max(1, int(np.floor(np.sum(variances) ** 2 / np.sum(variances**2 / (sizes - 1)) + 1e-9)))
    stretch = stats.t.ppf(0.975, df) / stats.norm.ppf(0.975) * np.sqrt(
        np.sum(variances) / np.sum((sizes - 1) / sizes * variances))
    samples = []
    for _ in range(SAMPLES):
        courses = rng.integers(num_courses, size=num_courses)
        drawn = [t[rng.integers(len(t), size=len(t))][:, courses] for t in tables]
        samples.append(statistic(*drawn))
    ends = value + stretch * (np.quantile(samples, [0.025, 0.975]) - value)
    return [min(value, max(limits[0], ends[0])), max(value, min(limits[1], ends[1]))]


def interval(tables, statistic, rng, limits=(0.0, 1.0), step=0.0):
    runs = np.array([interval_once(tables, statistic, limits, rng) for _ in range(RUNS)])
    tolerance = np.maximum(5 * runs.std(axis=0, ddof=1) * np.sqrt(1 + 1 / RUNS), step)
    return {"low": runs[:, 0].mean(), "high": runs[:, 1].mean(), "tolerance": (tolerance + 1e-9).tolist()}


def sign_flip(x, y):
    differences = x.mean(axis=0) - y.mean(axis=0)
    return stats.permutation_test((differences, np.zeros_like(differences)), lambda a, b: np.mean(a - b),
                                  permutation_type="samples", n_resamples=np.inf).pvalue


def relabelling(x, y):
    return stats.permutation_test((x.mean(axis=1), y.mean(axis=1)), lambda a, b: abs(np.mean(a) - np.mean(b)),
                                  permutation_type="independent", alternative="greater", n_resamples=np.inf).pvalue


def holm(p_values):
    order = np.argsort(p_values, kind="stable")
    steps = np.asarray(p_values)[order] * np.arange(len(p_values), 0, -1)
    corrected = np.empty(len(p_values))
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(steps))
    return corrected.tolist()


def student(df):
    """The 0.975 quantile; stats.t.ppf is off by 3e-9 for 49 degrees of freedom, while stats.t.cdf is not."""
    return optimize.brentq(lambda t: stats.t.cdf(t, df) - 0.975, 1.0, 13.0, xtol=1e-13)


def case(name, x, y, rng):
    thresholds = [0.0, 0.1, 0.25, 0.5, 0.7, 0.9, 1.0]
    result = {
        "name": name,
        "first": x.tolist(),
        "second": y.tolist(),
        "thresholds": thresholds,
        "mean": np.mean(x),
        "interquartile_mean": iqm(x),
        "profile": [float(np.mean(x > t)) for t in thresholds],
        "difference": np.mean(x) - np.mean(y),
        "improvement": improvement(x, y),
        "sign_flip_p": sign_flip(x, y),
        "intervals": {
            "mean": interval([x], np.mean, rng),
            "interquartile_mean": interval([x], iqm, rng),
            "share_above_half": interval([x], lambda t: np.mean(t > 0.5), rng, step=2 / x.size),
            "difference": interval([x, y], lambda a, b: np.mean(a) - np.mean(b), rng, limits=(-1.0, 1.0)),
            "improvement": interval([x, y], fast_improvement, rng, step=1 / (len(x) * y.size)),
        },
    }
    if len(x) > 1 and len(y) > 1:
        result["relabelling_p"] = relabelling(x, y)
    return result


def table(rng, seeds, courses, shift, digits):
    difficulty = rng.uniform(0.2, 0.9, size=courses)
    scores = difficulty + shift + rng.normal(0, 0.06, size=(seeds, 1)) + rng.normal(0, 0.1, size=(seeds, courses))
    return np.round(np.clip(scores, 0.0, 1.0), digits)


def main():
    rng = np.random.default_rng(20211)
    cases = [
        case("tenths, 5 and 4 seeds, 12 courses", table(rng, 5, 12, 0.1, 1), table(rng, 4, 12, 0.0, 1), rng),
        case("fine, 3 and 3 seeds, 14 courses", table(rng, 3, 14, 0.05, 6), table(rng, 3, 14, 0.0, 6), rng),
        case("fine, single seeds, 9 courses", table(rng, 1, 9, 0.0, 6), table(rng, 1, 9, -0.1, 6), rng),
    ]
    sums = rng.uniform(5.0, 40.0, size=(3, 10)).round(3)
    counts = rng.integers(1, 6, size=(3, 10)).astype(float)
    stacked = np.stack([sums, counts], axis=-1)  # One table of pairs, drawn together.
    ratio = interval([stacked], lambda t: t[..., 0].sum() / t[..., 1].sum(), rng, limits=(0.0, np.inf))
    x = np.cumsum(rng.uniform(0.5, 3.0, size=8)).round(4)
    y = rng.uniform(0.0, 1.0, size=8).round(4)
    p_values = rng.uniform(0.0, 0.2, size=9).round(4).tolist() + [0.0004, 0.0004, 1.0]
    print(json.dumps({
        "versions": {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__},
        "samples": SAMPLES,
        "cases": cases,
        "ratio": {"sums": sums.tolist(), "counts": counts.tolist(), "value": sums.sum() / counts.sum(), "interval": ratio},
        "area": {"x": x.tolist(), "y": y.tolist(), "value": np.trapz(y, x) / (x[-1] - x[0])},
        "holm": {"p": p_values, "corrected": holm(p_values)},
        "student": {str(df): student(df) for df in (1, 2, 3, 4, 9, 49, 300)},
    }, indent=1))


main()
