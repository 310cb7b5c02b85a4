"""Greedy selection against the published sequence, and against sums over all trajectories."""

from __future__ import annotations

from itertools import combinations

import dense_selection as dense
import numpy as np
import pytest
from toy_tables import grid_world, published_grid

from mlci.credible_sets import neighbours
from mlci.demonstrations import Demonstration
from mlci.grids import Grid
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.sets.evidence import SetEvidence
from mlci.sets.posterior import SetPrior, enumerate_sets
from mlci.sets.selection import select_constraints, select_regions
from mlci.systems import Pendulum
from mlci.tabular import action_grid, discretize
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.tables import Table, TablePath, TableRegion

# Scobee and Sastry's demonstration, and KL after each constraint that their code adds.
ACTIONS = [2, 2, 2, 2, 2, 1, 2, 1, 7, 7, 7, 7, 7, 7]
PUBLISHED = {
    "action 5": 24.623707798,
    "green": 16.706309105,
    "state 31": 12.055524120,
    "state 39": 7.661890326,
    "state 47": 2.724126394,
    "state 37": 1.513969539,
    "state 54": 0.862539251,
    "action 3": 0.402498614,
    "action 4": 0.054855427,
}


def test_published_sequence() -> None:
    table = published_grid()
    selection = select_constraints(table, [table.path(0, ACTIONS)], least=0.1)
    frame = selection.to_frame()
    assert frame["hypothesis"].tolist() == list(PUBLISHED)
    np.testing.assert_allclose(frame["kl"], list(PUBLISHED.values()), atol=1e-8)
    assert selection.kl[0] == pytest.approx(4 * 14 - 25.937183169, abs=1e-8)
    assert 0 < selection.next_decrease <= 0.1
    assert set(np.flatnonzero(selection.mask)) == set(selection.added)


def small() -> tuple[Table, list[TablePath]]:
    """A 4 x 4 grid whose hypotheses are its states, and three paths round it, two of them alike."""
    regions = {f"state {s}": TableRegion(states=[s]) for s in range(16)}
    table = grid_world(4, goal=15, reward=-3.0, regions=regions)
    paths = [table.path(0, actions) for actions in ([2, 2, 2, 1, 1, 1], [2, 2, 5, 1, 1])]
    return table, [*paths, paths[0]]


def divergence(table: Table, paths: list[TablePath]) -> float:
    """sum of p log(p / q) over the different paths, from the equation."""
    keys = [tuple(path.actions) for path in paths]
    log_z, total = FirstExit(table).log_z, 0.0
    for key in set(keys):
        path, share = paths[keys.index(key)], keys.count(key) / len(keys)
        reward = sum(table.reward[s, a] for s, a in zip(path.states, path.actions, strict=False))
        total += share * (np.log(share) - reward + log_z[path.states[0]])
    return total


def test_each_step_is_the_best_of_all_and_the_last_one_too_small() -> None:
    table, paths = small()
    crossed = np.any([table.crossed_by(path) for path in paths], axis=0)
    selection = select_constraints(table, paths, least=0.02)
    assert len(selection.added) >= 2
    mask = np.zeros(len(crossed), dtype=bool)
    for k, i in enumerate([*selection.added, -1]):
        assert selection.kl[k] == pytest.approx(divergence(table.under(mask), paths), abs=1e-12)
        rest = np.flatnonzero(~crossed & ~mask)
        trials = [mask | (np.arange(len(mask)) == j) for j in rest]
        after = [divergence(table.under(trial), paths) for trial in trials]
        if i < 0:
            assert selection.kl[k] - min(after, default=np.inf) <= 0.02
        else:
            assert i == rest[np.argmin(after)]
            mask[i] = True


def test_it_stops_at_the_most() -> None:
    table, paths = small()
    everything = select_constraints(table, paths, least=0.02)
    one = select_constraints(table, paths, least=0.02, most=1)
    assert one.added.tolist() == everything.added[:1].tolist()
    assert one.next_decrease == pytest.approx(everything.kl[1] - everything.kl[2])


def test_with_nothing_left_the_next_decrease_is_0() -> None:
    table, paths = small()
    everything = select_constraints(table, paths, least=-np.inf)
    crossed = np.any([table.crossed_by(path) for path in paths], axis=0)
    assert set(everything.added) == set(np.flatnonzero(~crossed))
    assert everything.next_decrease == 0


def test_of_equal_hypotheses_the_first_is_taken() -> None:
    table, paths = small()
    names = list(table.regions)
    first = names[select_constraints(table, paths, least=0.02).added[0]]
    twice = Table.from_arrays(
        table.successor, -3.0, 0, 15, {**table.regions, "copy": table.regions[first]}
    )
    assert names[select_constraints(twice, paths, least=0.02).added[0]] == first


@pytest.mark.parametrize(
    ("states", "actions", "message"),
    [
        ([1, 2], [1], "path 'walk' starts in 1, where the table does not"),
        ([0, 1], [1], r"path 'walk' ends in 1, which is none of the goals \[2\]"),
    ],
)
def test_a_path_from_elsewhere_is_refused(
    states: list[int], actions: list[int], message: str
) -> None:
    table = Table.from_arrays([[-1, 1], [0, 2], [-1, -1]], -1.0, 0, 2)
    with pytest.raises(ValueError, match=message):
        select_constraints(table, [TablePath(np.array(states), np.array(actions), "walk")])


def test_no_paths_select_nothing() -> None:
    with pytest.raises(ValueError, match="selected by paths, and there are none"):
        select_constraints(published_grid(), [])


def test_a_long_horizon_selects_what_first_exit_does() -> None:
    table, paths = small()
    any_length = select_constraints(table, paths, least=0.02)
    horizon = select_constraints(table, paths, least=0.02, steps=200)
    assert horizon.added.tolist() == any_length.added.tolist()
    np.testing.assert_allclose(horizon.kl, any_length.kl, atol=1e-9)
    assert horizon.next_decrease == pytest.approx(any_length.next_decrease, abs=1e-9)


@pytest.mark.parametrize(("goals", "steps"), [([15], 5), ([], 5), ([], 7)])
def test_a_path_beyond_the_horizon_is_refused(goals: list[int], steps: int) -> None:
    table, paths = small()
    table = Table.from_arrays(table.successor, -3.0, 0, goals, table.regions)
    with pytest.raises(ValueError, match=f"a path has 6 moves, the horizon {steps}"):
        select_constraints(table, paths, steps=steps)


@pytest.mark.parametrize("steps", [None, 1])
def test_pruning_drops_what_others_explain(steps: int | None) -> None:
    """Five moves of weights 1, 1, 2, 2, 1 lead to the goal, and the path takes the first. The
    heaviest pair of the others is added first, and needless beside the pairs that cover it."""
    pairs = {"middle": [2, 3], "left": [1, 2], "right": [3, 4]}
    regions = {name: TableRegion(actions=actions) for name, actions in pairs.items()}
    reward = np.log([[1.0, 1.0, 2.0, 2.0, 1.0]])
    table = Table.from_arrays([[1] * 5, [-1] * 5], reward, 0, 1, regions)
    path = table.path(0, [0])
    greedy = select_constraints(table, [path], steps=steps)
    assert greedy.to_frame()["hypothesis"].tolist() == ["middle", "left", "right"]
    np.testing.assert_allclose(greedy.kl, np.log([7, 3, 2, 1]), atol=1e-12)
    pruned = select_constraints(table, [path], steps=steps, prune=True)
    assert pruned.to_frame()["hypothesis"].tolist() == ["left", "right"]
    np.testing.assert_allclose(pruned.kl, np.log([7, 4, 1]), atol=1e-12)


def test_pruning_keeps_what_is_needed() -> None:
    table, paths = small()
    pruned = select_constraints(table, paths, least=0.02, prune=True)
    assert len(pruned.added) > 0
    full = divergence(table.under(pruned.mask), paths)
    assert pruned.kl[-1] == pytest.approx(full, abs=1e-12)
    for i in pruned.added:
        rest = pruned.mask & (np.arange(len(pruned.mask)) != i)
        assert divergence(table.under(rest), paths) > full + 0.02


@pytest.mark.parametrize("steps", [None, 1])
def test_a_beam_meets_a_pair_without_the_best_single_one(steps: int | None) -> None:
    """Moves of weights 1, 2, 2, 3, 3 lead to the goal, and the path takes the first. The heaviest
    hypothesis is in no pair that leaves the path alone, as the other two do."""
    moves = {"middle": [3, 4], "left": [1, 3], "right": [2, 4]}
    regions = {name: TableRegion(actions=actions) for name, actions in moves.items()}
    reward = np.log([[1.0, 2.0, 2.0, 3.0, 3.0]])
    table = Table.from_arrays([[1] * 5, [-1] * 5], reward, 0, 1, regions)
    path = table.path(0, [0])
    greedy = select_constraints(table, [path], steps=steps, most=2)
    assert greedy.to_frame()["hypothesis"].tolist() == ["middle", "left"]
    beam = select_constraints(table, [path], steps=steps, most=2, width=3)
    np.testing.assert_allclose(greedy.kl, np.log([11, 5, 3]), atol=1e-12)
    np.testing.assert_allclose(beam.kl, np.log([11, 6, 1]), atol=1e-12)
    assert beam.to_frame()["hypothesis"].tolist() == ["left", "right"]


def test_a_beam_as_wide_as_all_sets_finds_the_best_of_each_size() -> None:
    table, paths = small()
    feasible = ~np.any([table.crossed_by(path) for path in paths], axis=0)
    for size in (1, 2, 3):
        every = [
            divergence(table.under(np.isin(np.arange(16), one)), paths)
            for one in combinations(np.flatnonzero(feasible), size)
        ]
        wide = select_constraints(table, paths, least=-np.inf, most=size, width=1000)
        assert wide.kl[-1] == pytest.approx(min(every), abs=1e-12)
        assert len(wide.added) == size


def rectangle_world() -> tuple[SetEvidence, Regions]:
    """Two paths that swing a pendulum, and the evidence for sets of 30 regions."""
    system = Pendulum()
    regions = Regions.from_grid(system.space, (6, 5))
    grid, actions = Grid(system.space, (20, 20)), action_grid(system, 9)
    model = discretize(system, grid, actions, 0.25, regions)
    paths = [[[0.5, 0.1], [2.0, 1.0], [3.0, 0.2]], [[4.0, 0.1], [2.5, -1.0], [1.0, -0.2]]]
    demonstrations = [Demonstration.from_path(path, 1.5) for path in paths]
    inference = infer(model, demonstrations)
    return SetEvidence.of(model, demonstrations, inference), regions


def test_regions_of_a_model_are_added_while_they_gain() -> None:
    evidence, regions = rectangle_world()
    selection = select_regions(evidence, regions.names, least=0.02)
    assert len(selection.added) >= 2
    mask = np.zeros(30, dtype=bool)
    for k, i in enumerate([*selection.added, -1]):
        rest = np.flatnonzero(evidence.feasible & ~mask)
        after = [evidence.gain(mask | (np.arange(30) == j)) for j in rest]
        rise = (np.max(after) - evidence.gain(mask)) / 2  # for each demonstration
        if i < 0:
            assert selection.next_decrease == pytest.approx(rise, abs=1e-12)
            assert rise <= 0.02
        else:
            assert i == rest[np.argmax(after)]
            assert selection.decrease[k] == pytest.approx(rise, abs=1e-12)
            mask[i] = True
    assert np.isnan(selection.kl).all()
    assert not np.any(evidence.violated[:, selection.added])


def test_with_a_prior_it_climbs_the_posterior() -> None:
    evidence, regions = rectangle_world()
    prior = SetPrior((0.5, 0.3, 0.2), adjacency=1.0, neighbours=neighbours(regions))
    wide = select_regions(evidence, regions.names, 0.0, prior=prior, width=500)
    exact = enumerate_sets(evidence, prior)
    assert tuple(sorted(wide.added)) == exact.most_probable()
    without = exact.weight[~exact.members.any(axis=1)][0]
    assert np.sum(wide.decrease) * 2 == pytest.approx(exact.weight.max() - without, abs=1e-10)


def test_pruned_regions_are_explained_by_others() -> None:
    evidence, regions = rectangle_world()
    full = select_regions(evidence, regions.names, least=0.0)
    pruned = select_regions(evidence, regions.names, least=0.0, prune=True)
    assert set(pruned.added) <= set(full.added)
    for i in pruned.added:
        rest = pruned.mask & (np.arange(30) != i)
        assert evidence.gain(pruned.mask) > evidence.gain(rest)


def test_a_region_that_cannot_be_avoided_comes_first_and_ends_it() -> None:
    def beside(others: np.ndarray) -> np.ndarray:
        return np.where(others[2] | (np.arange(3) == 2), -np.inf, np.log(0.5))

    evidence = SetEvidence([beside], np.zeros((1, 3), dtype=bool))
    selection = select_regions(evidence, ("a", "b", "c"), least=0.0)
    assert selection.added.tolist() == [2]
    assert selection.decrease.tolist() == [np.inf]


def test_what_cannot_be_selected_by_is_refused() -> None:
    evidence, regions = rectangle_world()
    with pytest.raises(ValueError, match="at least one set, not 0"):
        select_regions(evidence, regions.names, width=0)
    for options in ({"least": np.nan}, {"most": -1}):
        with pytest.raises(ValueError, match="least is a number, and most one from 0 up"):
            select_regions(evidence, regions.names, **options)
    with pytest.raises(ValueError, match="1 names do not fit"):
        select_regions(evidence, regions.names[:1])
    with pytest.raises(ValueError, match="selected by demonstrations, and there are none"):
        select_regions(evidence.of_some([]), regions.names)


def as_paths(table: Table, paths: list[list[dense.Move]]) -> list[TablePath]:
    """The oracle's paths for the library."""
    return [table.path(path[0][0], [action for _, action, _ in path]) for path in paths]


@pytest.mark.parametrize("seed", range(4))
def test_random_demonstrations_of_the_grid_against_dense_matrices(seed: int) -> None:
    """One to eight paths, some alike, that keep out of two random hypotheses."""
    rng = np.random.default_rng(seed)
    table, sets = published_grid(), dense.hypotheses()
    names = [name for name in sets if name not in ("state 0", "state 8", "action 7")]
    truth = set[dense.Move]().union(*(sets[name] for name in rng.choice(names, 2, replace=False)))
    paths = [dense.sample(rng, 0, 8, truth, 2.0) for _ in range(rng.integers(1, 6))]
    paths += paths[: rng.integers(0, 3)]
    least = float(rng.choice([0.05, 0.1, 0.5]))
    added, kl, following = dense.select(paths, 8, least)
    ours = select_constraints(table, as_paths(table, paths), least)
    assert ours.to_frame()["hypothesis"].tolist() == added
    np.testing.assert_allclose(ours.kl, kl, atol=1e-8)  # of up to 60 nat, by two solvers
    assert ours.next_decrease == pytest.approx(following, abs=1e-8)
    assert len(added) >= 1
