"""R-hat and effective samples of chains whose worth is known."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.sets.chains import ChainCheck, effective_samples, split_r_hat


def autoregressive(rho: float, chains: int = 4, steps: int = 20000) -> np.ndarray:
    """x_t = rho x_(t-1) + noise, of variance 1."""
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(steps, chains)) * np.sqrt(1 - rho**2)
    draws = np.empty((steps, chains))
    draws[0] = rng.normal(size=chains)
    for t in range(1, steps):
        draws[t] = rho * draws[t - 1] + noise[t]
    return draws.T[:, :, None]


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_effective_samples_of_an_autoregression(rho: float) -> None:
    """sum of rho_t = rho / (1 - rho), so that it is worth M T (1 - rho) / (1 + rho)."""
    draws = autoregressive(rho)
    expected = draws.size * (1 - rho) / (1 + rho)
    # The sum over noisy correlations is known to some percent at this length.
    assert effective_samples(draws)[0] == pytest.approx(expected, rel=0.1)
    assert split_r_hat(draws)[0] == pytest.approx(1, abs=0.01)
    check = ChainCheck.of(draws, 0.5)
    assert check.standard_error[0] == pytest.approx(1 / np.sqrt(expected), rel=0.1)
    assert check.agrees
    assert "chains agree (R-hat 1.0" in str(check)


def test_chains_that_disagree_or_drift_are_noticed() -> None:
    draws = autoregressive(0.0, steps=400)
    apart = draws + np.array([0, 0, 0, 1.0])[:, None, None]
    # Means of eight halves, two of them 1, vary by 3 / 14; each is known to 1 / sqrt(200).
    assert split_r_hat(apart)[0] == pytest.approx(np.sqrt(1 + 3 / 14), abs=0.05)
    drift = draws + np.linspace(0, 2, 400)[None, :, None]
    assert split_r_hat(drift)[0] > 1.1
    assert effective_samples(apart)[0] < 0.1 * draws.size
    assert "DISAGREE" in str(ChainCheck.of(apart, 0.5))


@pytest.mark.parametrize("steps", [8, 9])
def test_r_hat_of_short_chains_is_that_of_the_book(steps: int) -> None:
    """Bayesian Data Analysis, (11.1) to (11.4), sum by sum: of short halves each factor counts."""
    draws = np.random.default_rng(1).normal(size=(3, steps, 2)) + np.arange(3)[:, None, None]
    n = steps // 2
    for q in range(2):
        halves = [part for chain in draws[:, :, q] for part in (chain[:n], chain[-n:])]
        means = [sum(half) / n for half in halves]
        middle = sum(means) / len(means)
        between = n / (len(halves) - 1) * sum((mean - middle) ** 2 for mean in means)
        variances = [
            sum((x - mean) ** 2 for x in half) / (n - 1)
            for half, mean in zip(halves, means, strict=True)
        ]
        within = sum(variances) / len(variances)
        expected = np.sqrt(((n - 1) / n * within + between / n) / within)
        assert split_r_hat(draws)[q] == pytest.approx(expected, rel=1e-12)


def test_effective_samples_of_short_chains_are_those_of_the_book() -> None:
    """(11.7) and (11.8) by variograms, with pairs of correlations as long as they are positive."""
    draws = autoregressive(0.6, chains=3, steps=24)[:, :, 0]
    chains, steps = draws.shape
    within = np.mean(np.var(draws, axis=1, ddof=1))
    total = (steps - 1) / steps * within + np.var(np.mean(draws, axis=1), ddof=1)
    means = np.mean(draws, axis=1, keepdims=True)
    rho = [
        1
        - (
            within
            - np.mean(
                np.sum((draws - means)[:, : steps - t] * (draws - means)[:, t:], axis=1) / steps
            )
        )
        / total
        for t in range(steps)
    ]
    length, t = -1.0, 0
    while t + 1 < steps and rho[t] + rho[t + 1] > 0:
        length += 2 * (rho[t] + rho[t + 1])
        t += 2
    expected = chains * steps / max(length, 1)
    assert effective_samples(draws[:, :, None])[0] == pytest.approx(expected, rel=1e-9)
    assert expected < chains * steps


def test_chains_agree_up_to_the_limit_and_each_quantity_counts() -> None:
    one = np.ones(2)
    for worst, agrees in ((1.05, True), (1.0501, False)):
        check = ChainCheck(np.array([1.0, worst]), 10 * one, 0.1 * one, 0.5)
        assert check.agrees == agrees
    assert "R-hat 1.050), worth at least 10 samples" in str(check)


def test_what_never_changes() -> None:
    stuck = np.zeros((2, 10, 2))
    stuck[1, :, 1] = 1.0
    np.testing.assert_array_equal(split_r_hat(stuck), [1.0, np.inf])
    check = ChainCheck.of(stuck, 0.0)
    assert not check.agrees
    assert check.standard_error[0] == 0
