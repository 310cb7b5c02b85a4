"""Misfit, against every trajectory of small models, and against exact probabilities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_models import every_trajectory, toy_world

from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.misfit import Misfit, excess_of, misfit, sample_crossings
from mlci.regions import Regions
from mlci.spaces import Box
from mlci.systems import DoubleIntegrator
from mlci.tabular import action_grid, discretize

STEPS = 5


def test_p_is_the_weight_of_trajectories_at_least_as_extreme() -> None:
    """For every set of regions that a trajectory can cross; 40000 draws, five standard errors."""
    model, goal, draws = toy_world(), 3, 40_000
    crossed, weight = every_trajectory(model, goal, STEPS)
    phi = weight @ crossed
    sets = np.unique(crossed, axis=0)
    assert len(sets) > 5
    distribution = TrajectoryDistribution(model, 0, np.array([goal]), STEPS)
    result = misfit([distribution] * len(sets), np.tile(phi, (len(sets), 1)), sets, samples=draws)
    counts, distances = crossed.sum(axis=1), np.abs(phi - crossed).sum(axis=1)
    for j, one in enumerate(sets):
        count, distance = one.sum(), np.abs(phi - one).sum()
        assert result.count[j] == count
        assert result.distance[j] == pytest.approx(distance)
        tail = min(weight[counts >= count].sum(), weight[counts <= count].sum())
        assert result.count_p[j] == pytest.approx(min(1, 2 * tail), abs=5 / np.sqrt(draws))
        far = weight[distances >= distance - 1e-9].sum()
        assert result.distance_p[j] == pytest.approx(far, abs=2.5 / np.sqrt(draws))


SYSTEM = DoubleIntegrator()
MODEL = discretize(
    SYSTEM,
    Grid(SYSTEM.space, (9, 8)),
    action_grid(SYSTEM, 5),
    0.5,
    Regions.from_grid(SYSTEM.space, (6, 6)),
)


@pytest.mark.parametrize("exact_ends", [True, False])
@pytest.mark.parametrize("horizon", [0.5, 1.0, 4.0])
def test_draws_cross_regions_as_often_as_the_exact_probabilities_say(
    horizon: float, exact_ends: bool
) -> None:
    """One move, two, and many; 20000 draws, five standard errors."""
    task = Task(np.array([-0.6, 0.3]), Box([-0.9, -np.inf], [1.0, np.inf]), horizon)
    distribution = TrajectoryDistribution.of_task(MODEL, task, exact_ends=exact_ends)
    phi, draws = distribution.violation_probabilities(), 20_000
    crossed = sample_crossings(distribution, draws, np.random.default_rng(1))
    error = np.sqrt(phi * (1 - phi) / draws)
    assert np.all(np.abs(crossed.mean(axis=0) - phi) <= 5 * error + 1e-12)
    assert np.any((phi > 0.01) & (phi < 0.99))


def test_the_models_own_trajectories_are_rarely_called_rare() -> None:
    """100 of them; at most 1 in 50 is expected, and a path all over the place is always rare."""
    task = Task(np.array([-1.0, 0.0]), Box.point([1.0, 0.0]), 5.0)
    distribution = TrajectoryDistribution.of_task(MODEL, task, exact_ends=True)
    own = sample_crossings(distribution, 100, np.random.default_rng(2))
    phi = np.tile(distribution.violation_probabilities(), (100, 1))
    share = np.mean(misfit([distribution] * 100, phi, own).is_rare)
    assert share < 0.02 + 4 * np.sqrt(0.02 * 0.98 / 100)  # four standard errors above that
    everywhere = misfit([distribution], phi[:1], np.ones((1, 36), dtype=bool))
    assert everywhere.is_rare.all()
    assert everywhere.count_p == pytest.approx(2 / 250)
    assert everywhere.distance_p == pytest.approx(1 / 250)
    again = misfit([distribution], phi[:1], np.ones((1, 36), dtype=bool))
    assert again.distance_p == everywhere.distance_p


def test_a_mask_picks_the_hypotheses() -> None:
    task = Task(np.array([-1.0, 0.0]), Box.point([1.0, 0.0]), 5.0)
    distribution = TrajectoryDistribution.of_task(MODEL, task, exact_ends=True)
    mask = np.arange(36) % 3 == 1
    phi = distribution.violation_probabilities()[None, mask]
    own = sample_crossings(distribution, 1, np.random.default_rng(3))[:, mask]
    result = misfit([distribution], phi, own, hypotheses=mask)
    assert result.count == own.sum()
    assert not result.is_rare.any()


@pytest.mark.parametrize("exact_ends", [True, False])
def test_a_task_that_cannot_be_done_has_no_p(exact_ends: bool) -> None:
    task = Task(np.array([-2.9, 0.0]), Box.point([2.9, 0.0]), 1.0)
    distribution = TrajectoryDistribution.of_task(MODEL, task, exact_ends=exact_ends)
    result = misfit([distribution], np.zeros((1, 36)), np.ones((1, 36), dtype=bool))
    assert np.isnan([result.count_p, result.distance_p]).all()
    assert not result.is_rare.any()
    with pytest.raises(ValueError, match="reaches a goal"):
        sample_crossings(distribution, 1, np.random.default_rng(0))


def test_a_demonstration_is_unlike_simulated_ones_by_the_rank_of_its_excess() -> None:
    task = Task(np.array([-1.0, 0.0]), Box.point([1.0, 0.0]), 5.0)
    distribution = TrajectoryDistribution.of_task(MODEL, task, exact_ends=True)
    drawn = sample_crossings(distribution, 301, np.random.default_rng(4))
    phi = np.tile(distribution.violation_probabilities(), (301, 1))
    excess = excess_of(phi, drawn)
    assert np.mean(excess) == pytest.approx(0, abs=5 * np.std(excess) / np.sqrt(301))
    one, others = slice(0, 1), excess[1:]
    result = misfit([distribution], phi[one], drawn[one], samples=0, simulated=others)
    larger = sum(other >= excess[0] - 1e-9 for other in others)
    assert result.unlike_p == pytest.approx((1 + larger) / 301)
    assert np.isnan([result.count_p, result.distance_p]).all()
    too_few = misfit([distribution], phi[one], drawn[one], samples=0, simulated=others[:99])
    assert np.isnan(too_few.unlike_p).all()
    far = misfit([distribution], phi[one], np.ones((1, 36), dtype=bool), simulated=others)
    assert far.unlike_p == pytest.approx(1 / 301)
    impossible = TrajectoryDistribution.of_task(MODEL, replace(task, horizon=0.5), exact_ends=True)
    assert np.isnan(misfit([impossible], phi[one], drawn[one], simulated=others).unlike_p).all()


def unlike(p: list[float]) -> Misfit:
    """Demonstrations of which only their p among 200 simulated ones is known."""
    none = np.full(len(p), np.nan)
    return Misfit(none, none, none, none, none, np.array(p), 200)


@pytest.mark.parametrize("simulated", [120, 200])
def test_right_sets_are_warned_of_in_one_of_twenty_at_most(simulated: int) -> None:
    """What is demonstrated and what is simulated come from the same distribution."""
    rng = np.random.default_rng(5)
    for count in (1, 3, 10, 65):
        names = [str(j) for j in range(count)]
        alarms = 0
        for _ in range(1500):
            others, own = rng.random(simulated), rng.random(count)
            p = (1 + np.sum(others >= own[:, None], axis=1)) / (1 + simulated)
            alarms += bool(replace(unlike(p.tolist()), simulated=simulated).warnings(names))
        assert alarms / 1500 < 0.05 + 4 * np.sqrt(0.05 * 0.95 / 1500)
        assert alarms > 0


def test_what_is_unlike_simulated_demonstrations_is_named() -> None:
    (few,) = unlike([0.005, 0.5, 0.3]).warnings(["a", "b", "c"])
    assert few.startswith("1 of 3 demonstrations cross other regions than simulated")
    # None of three is among the first two of 203: 1 - (201 200 199) / (203 202 201).
    assert f"by chance in {1 - 201 * 200 * 199 / (203 * 202 * 201):.1%} of such sets" in few
    assert few.endswith(": a")
    assert unlike([0.005, *[0.5] * 64]).warnings([str(j) for j in range(65)]) == []
    assert unlike([0.005, np.nan]).warnings(["a", "b"])  # the other task cannot be done
    assert unlike([0.5, 0.5]).warnings(["a", "b"]) == []


def test_without_a_calibration_what_is_rare_is_said_to_tell_little() -> None:
    none = np.full(2, np.nan)
    (text,) = Misfit(none, none, np.array([0.004, 0.5]), none, none, none).warnings(["a", "b"])
    assert text.startswith("1 of 2 demonstrations cross other regions than the model's own")
    assert "Optimal paths often do so too" in text
    assert text.endswith(": a")
    assert Misfit(none, none, np.array([0.5, 0.5]), none, none, none).warnings(["a", "b"]) == []
