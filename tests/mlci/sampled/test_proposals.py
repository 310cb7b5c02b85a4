import numpy as np
import pytest
from scipy.special import erf

from mlci.sampled.local_policies import LocalPolicies
from mlci.sampled.passage import Passage
from mlci.sampled.proposals import Proposal, draw
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import FunctionSystem

PLANE = FunctionSystem(
    lambda x, u: (u[..., 0], u[..., 1] + 0.3 * x[..., 0]),
    StateSpace(Box([-50.0, -50.0], [50.0, 50.0]), [False, False], ("x", "y")),
    Box([-1.0, -1.0], [1.0, 1.0]),
)
FREE = Box([-np.inf, -np.inf], [np.inf, np.inf])


def policies(rng: np.random.Generator, steps: int, scale: float) -> LocalPolicies:
    """Three policies that are not alike, with feedback and controls that depend on each other."""
    root = np.tril(rng.uniform(-0.5, 0.5, (3, steps, 2, 2))) + scale * np.eye(2)
    mean, gain = rng.uniform(-1, 1, (3, steps, 2)), rng.uniform(-0.5, 0.5, (3, steps, 2, 2))
    return LocalPolicies(np.array([0, 1, 1]), rng.normal(size=(3, steps, 2)), mean, gain, root)


def mean_weight(passage: Passage, seed: int, samples: int = 20_000) -> tuple[float, float, Floats]:
    """Mean of the weights with its standard error, and the controls."""
    rng = np.random.default_rng(seed)
    some = policies(rng, passage.steps, 1.2)
    draws = draw(passage, Proposal.of(some, np.array([0.5, 0.3, 0.2]), samples), rng)
    weight = np.exp(draws.log_weight)
    assert np.all(draws.reached)
    np.testing.assert_allclose(np.sum(draws.mode_share, axis=1), 1.0)
    return float(np.mean(weight)), float(np.std(weight) / np.sqrt(len(weight))), draws.controls


def test_weights_of_free_controls_add_up_to_their_integral():
    passage = Passage(PLANE, np.zeros(2), FREE, 3, 0.5, temperature=0.8)
    mean, error, _ = mean_weight(passage, 0)
    exact = (np.pi * 0.8 / 0.5) ** 3
    assert abs(mean - exact) < 3 * error
    assert error < 0.02 * exact


@pytest.mark.parametrize("limit", [Box([-0.5, -1.0], [1.0, 0.2]), Box([0.4, -1.5], [0.6, -1.2])])
def test_weights_of_limited_controls_add_up_to_their_integral(limit):
    passage = Passage(PLANE, np.zeros(2), FREE, 3, 0.5, temperature=0.8, limit=limit)
    mean, error, controls = mean_weight(passage, 1)
    root = np.sqrt(0.5 / 0.8)
    each = (erf(root * limit.upper) - erf(root * limit.lower)) * np.sqrt(np.pi) / (2 * root)
    assert abs(mean - np.prod(each) ** 3) < 3 * error
    assert error < 0.02 * mean
    assert np.all(limit.contains(controls))


def test_a_limit_far_from_a_policy_gives_numbers_still():
    passage = Passage(PLANE, np.zeros(2), FREE, 2, 0.5, limit=Box([40.0, -41.0], [41.0, -40.0]))
    some = policies(np.random.default_rng(0), 2, 1.0)
    draws = draw(passage, Proposal.of(some, np.full(3, 1 / 3), 200), np.random.default_rng(1))
    assert np.all(np.isfinite(draws.log_weight))
    assert np.all(passage.limit.contains(draws.controls))


def test_paths_that_leave_the_space_have_no_weight():
    narrow = FunctionSystem(
        PLANE.rates, StateSpace(Box([-0.5, -9.0], [9.0, 9.0]), [False, False], ("x", "y")), FREE
    )
    passage = Passage(narrow, np.zeros(2), FREE, 3, 0.5, substeps=2)
    some = policies(np.random.default_rng(0), 3, 1.0)
    draws = draw(passage, Proposal.of(some, np.full(3, 1 / 3), 500), np.random.default_rng(1))
    outside = np.any(draws.paths[:, :, 0] < -0.5, axis=1)
    assert 0.1 < np.mean(outside) < 0.9
    np.testing.assert_array_equal(draws.log_weight == -np.inf, outside)
    assert draws.paths.shape[1] == 7


def test_every_component_gives_a_path():
    some = policies(np.random.default_rng(0), 2, 1.0)
    proposal = Proposal.of(some, np.array([1.0, 0.0, 0.0]), 100)
    assert np.min(proposal.count) == 1
    assert np.sum(proposal.count) == 106
