import numpy as np
import pytest

from mlci.sampled.weights import deviations, effective_count, pareto_shape, replicates


def test_effective_samples_of_weights():
    assert effective_count(np.full(7, -900.0)) == pytest.approx(7)
    assert effective_count(np.log([3.0, 1.0])) == pytest.approx(16 / 10)
    assert effective_count(np.array([-np.inf, 2.0])) == 1
    assert effective_count(np.full(3, -np.inf)) == 0


def test_the_squares_of_deviations_add_up_to_the_variance_of_a_stratified_sum():
    rng, strata = np.random.default_rng(0), np.repeat([0, 1, 2], [40, 200, 60])
    means, scales = np.array([0.0, 5.0, -3.0]), np.array([1.0, 0.2, 2.0])
    draws = means[strata] + scales[strata] * rng.standard_normal((2000, 300))
    estimated = [np.sum(np.square(deviations(draw, strata))) for draw in draws]
    exact = 40 * 1.0 + 200 * 0.04 + 60 * 4.0
    assert np.mean(estimated) == pytest.approx(exact, rel=0.02)
    assert np.var(np.sum(draws, axis=1)) == pytest.approx(exact, rel=0.1)


def test_small_strata_are_taken_together_and_columns_do_not_mix():
    values = np.arange(12.0).reshape(6, 2) ** 2
    together = deviations(values, np.array([0, 0, 1, 1, 2, 3]))
    np.testing.assert_allclose(together, (values - np.mean(values, axis=0)) * np.sqrt(6 / 5))


@pytest.mark.parametrize("shape", [0.2, 0.5, 0.9])
def test_the_shape_of_a_pareto_tail_is_found(shape):
    rng = np.random.default_rng(3)
    found = [pareto_shape(-shape * np.log(rng.random(20_000))) for _ in range(20)]
    assert np.mean(found) == pytest.approx(shape, abs=0.06)


def test_the_shape_of_few_weights_is_drawn_towards_a_half():
    # 20 weights are in the tail, and the prior counts as 10 of shape 0.5.
    rng = np.random.default_rng(4)
    found = [pareto_shape(-0.2 * np.log(rng.random(100))) for _ in range(100)]
    assert np.mean(found) == pytest.approx((20 * 0.2 + 10 * 0.5) / 30, abs=0.1)


def test_too_few_weights_tell_no_shape_and_equal_ones_have_no_tail():
    assert pareto_shape(np.append(np.zeros(10), np.full(90, -np.inf))) == np.inf
    assert pareto_shape(np.zeros(8)) == np.inf
    assert pareto_shape(np.zeros(1000)) == -np.inf


def test_replicates_of_what_is_rare_have_its_mean_and_error_and_are_never_none():
    rng = np.random.default_rng(0)
    chance, errors = np.array([0.0, 0.004, 0.5, 1.0]), np.array([0.002, 0.004, 0.1, 0.002])
    influences = np.zeros((50, 4))
    influences[:, 2] = 0.1 / np.sqrt(50)
    drawn = replicates(chance, errors, influences, 0.001, 20_000, rng)
    assert np.all(drawn > 0)
    assert np.all(drawn <= 1)
    # Of 20000 draws a mean is known to 1 % of the error, as good as 0.05 of it here.
    expected = np.array([0.001, 0.004, 0.5, 0.999])
    np.testing.assert_array_less(np.abs(np.mean(drawn, axis=0) - expected), 0.05 * errors)
    np.testing.assert_allclose(np.std(drawn, axis=0), errors, rtol=0.1)
