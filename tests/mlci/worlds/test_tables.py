"""Tables from arrays: what belongs to a region, paths, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse
from toy_tables import chancy_world, grid_world, published_grid

from mlci.rivals.agent import Agent
from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table, TablePath, TableRegion

# Three states in a row, actions left and right; the last one is the goal.
LINE = np.array([[-1, 1], [0, 2], [1, -1]])


def line(**regions: TableRegion) -> Table:
    return Table.from_arrays(LINE, -1.0, 0, 2, regions)


def test_all_forms_of_transitions_say_the_same() -> None:
    dense = np.zeros((3, 2, 3))
    for state, action in np.argwhere(LINE >= 0):
        dense[state, action, LINE[state, action]] = 1.0
    for form in (LINE, dense, sparse.csr_matrix(dense.reshape(6, 3))):
        table = Table.from_arrays(form, -1.0, 0, 2)
        assert table.successor.tolist() == LINE.tolist()
        assert table.allowed.tolist() == [[False, True], [True, True], [False, False]]
        assert (table.states, table.actions) == (3, 2)


def test_sparse_transitions_are_left_as_they_are() -> None:
    given = sparse.csr_matrix(([0.5, 0.5, 0.0, 1.0], [1, 1, 0, 1], [0, 3, 4]), shape=(2, 2))
    table = Table.from_arrays(given, -1.0, 0, 1)
    assert table.successor.tolist() == [[1], [1]]
    assert given.nnz == 4


def test_a_state_forbids_every_move_into_or_out_of_it() -> None:
    table = line(middle=TableRegion(states=[1]), end=TableRegion(states=[2]))
    crosses = table.crosses.toarray().reshape(3, 2, 2)
    assert crosses[..., 0].tolist() == [[False, True], [True, True], [True, False]]
    assert crosses[..., 1].tolist() == [[False, False], [False, True], [True, True]]


def test_chance_of_entering_is_enough() -> None:
    world = chancy_world()
    table = Table.from_arrays(world.transitions, 0.0, 0, regions={"3": TableRegion(states=[3])})
    crosses = table.crosses.toarray().reshape(5, 3)
    expected = [
        [False, True, False],
        [True, True, False],
        [True, True, False],
        [True, True, True],
        [False, False, False],
    ]
    assert crosses.tolist() == expected


def test_actions_and_moves_forbid_themselves_and_regions_are_unions() -> None:
    table = line(
        left=TableRegion(actions=[0]),
        one=TableRegion(moves=[(0, 1)]),
        both=TableRegion(actions=[0], moves=[(0, 1), (1, 0)]),
    )
    crosses = table.crosses.toarray().reshape(3, 2, 3).astype(int)
    assert crosses[..., 0].tolist() == [[1, 0], [1, 0], [1, 0]]
    assert crosses[..., 1].tolist() == [[0, 1], [0, 0], [0, 0]]
    assert crosses[..., 2].tolist() == [[1, 1], [1, 0], [1, 0]]


def test_under_forbids_what_belongs_and_adds_up() -> None:
    table = line(left=TableRegion(actions=[0]), end=TableRegion(states=[2]))
    left = table.under(table.mask(["left"]))
    assert left.allowed.tolist() == [[False, True], [False, True], [False, False]]
    both = left.under(table.mask(["end"]))
    assert both.allowed.tolist() == [[False, True], [False, False], [False, False]]
    assert both.truth.all()


def test_a_path_follows_its_actions_and_belongs_to_what_it_meets() -> None:
    table = published_grid()
    path = table.path(0, [2, 2, 2, 2, 2, 1, 2, 1, 7, 7, 7, 7, 7, 7])
    assert path.states.tolist() == [0, 9, 18, 27, 36, 45, 46, 55, 56, 48, 40, 32, 24, 16, 8]
    names = np.array(list(table.regions))[table.crossed_by(path)]
    states = {f"state {s}" for s in path.states}
    assert set(names) == states | {"action 1", "action 2", "action 7"}


@pytest.mark.parametrize(
    ("states", "actions", "message"),
    [
        ([0, 2], [1], r"path 'walk', step 0: the table has no move by action 1 from state 0 to 2"),
        ([0, 1, 2, 1], [1, 1, 0], r"step 2: the table has no move by action 0 from state 2 to 1"),
        ([0, 3], [1], r"states of path 'walk' must be from 0 to 2, not 3"),
        ([0, 1], [2], r"actions of path 'walk' must be from 0 to 1, not 2"),
    ],
    ids=["other end", "beyond the goal", "no state", "no action"],
)
def test_a_path_that_the_table_lacks_is_refused(
    states: list[int], actions: list[int], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        line().moves_of(TablePath(np.array(states), np.array(actions), "walk"))


def test_a_path_needs_a_state_more_than_actions() -> None:
    with pytest.raises(ValueError, match="a path of 2 actions needs one state more, not"):
        TablePath(np.array([0, 1]), np.array([1, 1]))


def test_an_action_that_may_not_be_taken_leads_along_no_path() -> None:
    with pytest.raises(ValueError, match="action 1 may not be taken in state 2"):
        line().path(0, [1, 1, 1])


def out_of_range() -> sparse.csr_matrix:
    """A damaged array: one of its indices is beyond its shape."""
    array = sparse.csr_matrix(np.eye(3))
    array.indices[0] = 77
    return array


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"transitions": [[0.5]]}, "transitions are whole numbers"),
        ({"transitions": sparse.csr_matrix((5, 3))}, r"shape \(S \* A, S\), not \(5, 3\)"),
        ({"transitions": [[1], [2]]}, "successors must be from 0 to 1, not 2"),
        (
            {"transitions": np.full((2, 1, 2), 0.6)},
            "action 0 in state 0 must add up to 1, not 1.2; a state",
        ),
        (
            {"transitions": np.full((2, 1, 2), np.nan)},
            "action 0 in state 0 has the probability nan",
        ),
        (
            {"transitions": np.array([[[1.5, -0.5]], [[1, 0]]])},
            "action 0 in state 0 has the probability -0.5",
        ),
        ({"transitions": np.zeros((2, 1, 2), complex)}, "transitions are whole numbers"),
        ({"transitions": sparse.csr_matrix(np.eye(2) * 1j)}, "real numbers, not complex128"),
        ({"transitions": out_of_range()}, "indices must be < 3"),
        ({"reward": np.nan}, "must lie within 1e.09 nat, .* one is nan"),
        ({"reward": -1e300}, "must lie within 1e.09 nat, .* one is -1e.300"),
        ({"start": 3}, "the start must be from 0 to 2, not 3"),
        ({"start": [0.5, 0.4, 0.0]}, r"probabilities that add up to 1, not .* up to 0.9"),
        ({"start": [1.0, 0.0]}, r"or \(3,\) probabilities"),
        ({"goals": [0, -1]}, "goals must be from 0 to 2, not -1"),
        ({"regions": {"x": TableRegion(states=[3])}}, "states of a region must be from 0 to 2"),
        ({"regions": {"x": TableRegion(actions=[2])}}, "actions of a region must be from 0 to 1"),
        ({"regions": {"x": TableRegion(moves=[(0, 2)])}}, "actions of a region must be from 0"),
        ({"regions": {"x": TableRegion(moves=[(3, 0)])}}, "states of a region must be from 0"),
    ],
)
def test_what_is_no_table_is_refused(changes: dict[str, Any], message: str) -> None:
    arguments = {"transitions": LINE, "reward": -1.0, "start": 0, "goals": 2, **changes}
    with pytest.raises(ValueError, match=message):
        Table.from_arrays(**arguments)


def test_probabilities_in_few_digits_are_scaled() -> None:
    thirds = np.full((3, 1, 3), 1 / 3, dtype=np.float32)
    table = Table.from_arrays(thirds, -1.0, [0.3333333, 0.3333333, 0.3333333])
    np.testing.assert_allclose(table.transitions.sum(axis=1), 1, rtol=0, atol=1e-15)
    assert table.start.sum() == pytest.approx(1, abs=1e-15)
    exact = Table.from_arrays(np.array([[[0.1, 0.9]], [[0.7, 0.3]]]), -1.0, 0)
    assert exact.transitions.data.tolist() == [0.1, 0.9, 0.7, 0.3]


def test_a_world_of_chance_has_no_successors() -> None:
    with pytest.raises(ValueError, match="chance decides what follows action 0 in state 0"):
        _ = chancy_world().successor


def test_a_name_that_no_region_has_is_refused() -> None:
    with pytest.raises(ValueError, match="no region is called x; there are"):
        line(left=TableRegion(actions=[0])).mask(["x"])


def test_moves_end_at_the_edge_of_the_grid() -> None:
    assert np.sum(grid_world(3, goal=8).successor >= 0) == 4 * 3 + 4 * 5 + 8


@pytest.mark.parametrize(
    ("start", "goals", "message"),
    [
        (0.5, (), "the start must be whole numbers from 0 to 1, not 0.5"),
        (float("nan"), (), "the start must be whole numbers from 0 to 1, not nan"),
        (True, (), "the start must be whole numbers from 0 to 1, not True"),
        (0, [0.5], "goals must be whole numbers from 0 to 1, not 0.5"),
        (0, [True, False], "goals must be whole numbers from 0 to 1, not True"),
        (0, 2, "goals must be from 0 to 1, not 2"),
    ],
)
def test_numbers_of_states_are_whole(start: object, goals: object, message: str) -> None:
    """A mask, or a share of the way between two states, names no state."""
    with pytest.raises(ValueError, match=message):
        Table.from_arrays([[1], [0]], 0.0, start, goals)
    assert Table.from_arrays([[1], [0]], 0.0, 1.0, {1.0}).goals.tolist() == [1]


@pytest.mark.parametrize("steps", [2.5, float("nan"), 0])
def test_numbers_of_steps_are_whole(steps: object) -> None:
    table = Table.from_arrays([[1], [0]], 0.0, 0)
    for world in (FixedHorizon, CausalEntropy, Agent):
        with pytest.raises(ValueError, match=f"a whole number of steps, at least one, not {steps}"):
            world(table, steps)
    with pytest.raises(ValueError, match="final states must be from 0 to 1, not 7"):
        Agent(table, 2, final=np.array([7]))


def test_a_region_of_moves_holds_these_and_no_others() -> None:
    """Rows are s * A + a; three states in a row, and of the middle one the way back."""
    table = Table.from_arrays(
        [[0, 1], [0, 2], [1, 2]], 0.0, 0, regions={"back": TableRegion(moves=[(1, 0), (2, 1)])}
    )
    assert np.flatnonzero(table.crosses.toarray()[:, 0]).tolist() == [2, 5]
