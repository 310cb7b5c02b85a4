"""What is expected to be learnt, against exact distributions that are written down or listed."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.stats import entropy

from mlci.evidence import PAPER, Rates, log_evidence, posterior, total_gain
from mlci.spaces import Bools, Floats
from mlci.task_outcomes import TaskOutcomes, as_forecast, task_outcomes

# Four sets of regions that trajectories cross, as often as in `TIMES` of 200.
SETS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]], dtype=bool)
TIMES = np.array([40, 60, 80, 20])
BELIEF = np.array([0.3, 0.1, 0.2, 0.4])  # the last of no constraint


def drawn() -> Bools:
    """(200, 3) what trajectories cross."""
    return np.repeat(SETS, TIMES, axis=0)


def beliefs_after(rates: Rates) -> tuple[Floats, Floats]:
    """The belief (4, 4) after each set is seen, by `mlci.evidence`, and how probable that is."""
    share = TIMES / TIMES.sum()
    avoidance = np.tile(1 - share @ SETS, (len(SETS), 1))
    ratio = np.exp(log_evidence(avoidance, SETS, rates))
    weight = BELIEF * np.column_stack([ratio, np.ones(len(SETS))])
    predicted = share * weight.sum(axis=1)
    return weight / weight.sum(axis=1, keepdims=True), predicted


@pytest.mark.parametrize("rates", [PAPER, Rates(rule_breaking=0.2)])
def test_information_is_the_mean_drop_of_the_posteriors_entropy(rates: Rates) -> None:
    after, predicted = beliefs_after(rates)
    assert predicted.sum() == pytest.approx(1)
    drop = entropy(BELIEF) - predicted @ entropy(after, axis=1)
    outcomes = task_outcomes(drawn(), rates)
    assert outcomes.information(BELIEF) == pytest.approx(drop, abs=1e-12)
    moved = np.abs(after - BELIEF).sum(axis=1) / 2
    assert outcomes.chance(BELIEF) == pytest.approx(predicted[moved >= 0.1].sum())


def test_beliefs_that_are_learnt_are_as_frequent_as_predicted() -> None:
    """20 000 draws: a share has a standard error of 0.0035 at most; four of them."""
    after, predicted = beliefs_after(PAPER)
    many = np.tile(BELIEF, (20_000, 1))
    learnt = task_outcomes(drawn()).learnt(many, np.random.default_rng(3))
    for one, share in zip(after, predicted, strict=True):
        frequency = np.mean(np.all(np.isclose(learnt, one), axis=1))
        assert frequency == pytest.approx(share, abs=0.014)


def test_nothing_is_learnt_from_a_task_that_crosses_nothing() -> None:
    outcomes = task_outcomes(np.zeros((50, 3), dtype=bool))
    assert outcomes.information(BELIEF) == 0
    assert outcomes.chance(BELIEF) == 0
    assert outcomes.error(BELIEF) == 0


def test_information_is_between_nothing_and_the_entropy_of_the_belief() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        violated = rng.random((100, 6)) < rng.random(6)
        beliefs = rng.dirichlet(np.full(7, 0.5), 20)
        information = task_outcomes(violated).information(beliefs)
        assert np.all(information >= 0)
        assert np.all(information <= entropy(beliefs, axis=1) + 1e-12)


def test_regions_that_are_never_avoided_share_one_outcome() -> None:
    """Two of three are crossed by all: to see "neither is avoided" excludes both at once, and the
    other way round nothing tells them apart."""
    violated = np.tile([True, True, False], (50, 1))
    outcomes = task_outcomes(violated)
    either, other = BELIEF[0] + BELIEF[1], BELIEF[2] + BELIEF[3]
    assert outcomes.information(BELIEF) == pytest.approx(entropy([either, other]))


def test_the_error_is_the_spread_over_independent_trajectories() -> None:
    """400 sets of 300 trajectories: the spread is known to 3.5 %; four of that, and its bias."""
    rng, share = np.random.default_rng(1), TIMES / TIMES.sum()
    values, errors = [], []
    for _ in range(400):
        outcomes = task_outcomes(SETS[rng.choice(len(SETS), 300, p=share)])
        values.append(outcomes.information(BELIEF))
        errors.append(outcomes.error(BELIEF))
    assert np.mean(errors) == pytest.approx(np.std(values), rel=0.15)


def test_forecasts_are_met_in_both_directions() -> None:
    """One region is crossed less often than the model says, one more often; exact to 1 / 200."""
    violated = drawn()
    alpha = 1 - violated.mean(axis=0)
    forecast = np.array([0.6, 0.2, 0.9])
    changed = as_forecast(violated, alpha, forecast, np.random.default_rng(0))
    # Which level falls to which trajectory is random: a share of 200 has an error of 0.035.
    assert 1 - changed.mean(axis=0) == pytest.approx(forecast, abs=0.1)
    assert not np.any(changed[:, 0] & ~violated[:, 0])  # crossings are only taken away
    assert not np.any(~changed[:, 1] & violated[:, 1])  # or only added


def test_a_model_error_is_an_agent_who_crosses_nothing() -> None:
    """A share eta of trajectories loses all its crossings together, and none loses some."""
    violated, eta = drawn(), 0.25
    alpha = 1 - violated.mean(axis=0)
    changed = as_forecast(violated, alpha, (1 - eta) * alpha + eta, np.random.default_rng(0))
    lost = np.any(changed != violated, axis=1)
    assert not changed[lost].any()
    assert np.array_equal(changed[~lost], violated[~lost])
    everywhere = np.ones((200, 1), dtype=bool)
    kept = as_forecast(everywhere, np.zeros(1), np.array([eta]), np.random.default_rng(0))
    assert kept.mean() == 1 - eta  # levels are spread evenly


def test_what_is_certain_stays_certain() -> None:
    crossed, free = np.ones((20, 1), dtype=bool), np.zeros((20, 1), dtype=bool)
    rng = np.random.default_rng(0)
    assert as_forecast(crossed, np.zeros(1), np.zeros(1), rng).all()
    assert not as_forecast(free, np.ones(1), np.ones(1), rng).any()


def test_information_of_two_demonstrations_is_that_of_one_and_then_of_the_other() -> None:
    """The chain rule, over all pairs of outcomes, by `mlci.evidence`."""
    outcomes, share = task_outcomes(drawn()), TIMES / TIMES.sum()
    after, predicted = beliefs_after(PAPER)
    second = predicted @ outcomes.information(after)
    avoidance = 1 - share @ SETS
    total, left = 0.0, 0.0
    for one, other in itertools.product(range(4), repeat=2):
        evidence = log_evidence(np.tile(avoidance, (2, 1)), SETS[[one, other]])
        each, none = posterior(total_gain(evidence), BELIEF[-1], BELIEF[:3])
        ratio = BELIEF[-1] / none if none else 0.0  # m = p_none / q_none
        weight = share[one] * share[other] * ratio
        total += weight
        left += weight * entropy(np.append(each, none))
    assert total == pytest.approx(1)
    both = entropy(BELIEF) - left
    assert outcomes.information(BELIEF) + second == pytest.approx(both, abs=1e-12)


@pytest.mark.parametrize(("likely", "chance"), [(0.57, 0), (0.62, 1)])
def test_a_demonstration_reveals_something_from_a_tenth_of_the_belief_on(
    likely: float, chance: float
) -> None:
    """Of two equal beliefs, either outcome moves `likely` - 1 / 2 from one to the other."""
    outcomes = TaskOutcomes(np.array([[likely, 1 - likely], [1 - likely, likely]]), 10)
    assert outcomes.chance(np.array([0.5, 0.5])) == pytest.approx(chance)


def test_columns_that_do_not_add_up_are_refused() -> None:
    with pytest.raises(ValueError, match="add up to 1 in each column"):
        TaskOutcomes(np.full((3, 2), 0.5), 10)
