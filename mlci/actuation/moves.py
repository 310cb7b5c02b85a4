"""The moves of a tabular model, told apart by the hypotheses about controls that forbid them.

The tabular agent keeps to a hypothesis if it takes none of the moves that this forbids, so that the
probability of that is alpha, as for moves that cross a region: the recursion of
`mlci.recursions.backward_pass` with hypotheses in place of regions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.actuation.hypotheses import ControlHypotheses
from mlci.cells.protocol import check_has_cells
from mlci.demonstrations import Task
from mlci.end_moves import MovePaths, allowed_moves, first_paths, last_paths, only_paths
from mlci.joint_avoidance import log_avoidance_beside
from mlci.maxent import TrajectoryDistribution
from mlci.merged_moves import MergedMoves, joined, merge_moves
from mlci.recursions import Leg, backward_pass
from mlci.simulate import rollout
from mlci.single_moves import SingleMoves
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel


@dataclass(frozen=True, eq=False)
class ControlledMoves:
    """The moves of a tabular model by which of C hypotheses forbid them; made by `of`.

    Attributes:
        model: the tabular model.
        hypotheses: the C hypotheses.
        moves: its moves, merged where successor and hypotheses are the same; these stand in the
            place of regions, or follow them.
        shares: (C,) share of all moves that each hypothesis forbids.
        with_regions: whether moves are also told apart by the model's regions, C' of them, whose
            numbers come before those of the hypotheses.
    """

    model: TabularModel
    hypotheses: ControlHypotheses
    moves: MergedMoves
    shares: Floats
    with_regions: bool = False

    @classmethod
    def of(
        cls, model: TabularModel, hypotheses: ControlHypotheses, *, with_regions: bool = False
    ) -> ControlledMoves:
        """Look at every move of a model.

        Args:
            model: the tabular model.
            hypotheses: the C hypotheses.
            with_regions: also tell moves apart by the model's regions, for `joint_avoidance`.

        Raises:
            TypeError: a model without cells.
            ValueError: hypotheses about another system, or one that forbids no move, so that the
                model cannot tell.
        """
        check_has_cells(model)
        hypotheses.check(model.system)
        count, parts = np.zeros(len(hypotheses)), []
        for cells in model.blocks():
            block = _labelled(model, hypotheses, cells, with_regions)
            count += block.crosses.sum(axis=0).A1[-len(hypotheses) :]
            parts.append(merge_moves([block]))
        moves, known = joined(parts), model.explored
        cells_known = model.states if known is None else int(np.sum(known.cells))
        if known is not None:
            moves = moves.placed(np.flatnonzero(known.cells), model.states)
        for i in np.flatnonzero(count == 0):
            raise ValueError(
                f"{hypotheses.names[i]} forbids none of the model's moves, of {len(model.actions)} "
                "actions, so that the model cannot tell: take more actions, or a wider range"
            )
        return cls(model, hypotheses, moves, count / (cells_known * model.moves), with_regions)

    def avoidance(
        self, tasks: Sequence[Task], *, exact_ends: bool = True, round_horizon: bool = False
    ) -> Floats:
        """alpha (N, C): probability of no move that a hypothesis forbids; 1 where a task cannot be
        done.

        Args:
            tasks: the N tasks.
            exact_ends: as of `mlci.infer`.
            round_horizon: likewise.
        """
        alpha = np.ones((len(tasks), len(self.hypotheses)))
        for row, task in zip(alpha, tasks, strict=True):
            way = TrajectoryDistribution.of_task(
                self.model, task, round_horizon=round_horizon, exact_ends=exact_ends
            )
            if way.is_possible:
                legs = self._legs(way)
                row[:] = backward_pass(legs, way.reachable, way.goal, way.start, len(row))[1]
        return alpha

    def joint_avoidance(
        self, tasks: Sequence[Task], *, exact_ends: bool = True, round_horizon: bool = False
    ) -> Floats:
        """alpha (N, C' + 1, C + 1): of no move that enters a region or that a hypothesis forbids.

        The last of each axis is of no region, and of no hypothesis about controls. All are
        probabilities under one distribution a task, that of the agent whom nothing keeps from
        anything: a recursion for each hypothesis gives it with every region, see
        `mlci.joint_avoidance`. 1 where a task cannot be done.

        Args:
            tasks: the N tasks.
            exact_ends: as of `mlci.infer`.
            round_horizon: likewise.

        Raises:
            ValueError: moves that are not told apart by regions.
        """
        if not self.with_regions:
            raise ValueError("moves must be told apart by regions: with_regions=True")
        regions, controls = len(self.model.regions), len(self.hypotheses)
        alpha = np.ones((len(tasks), regions + 1, controls + 1))
        for of_task, task in zip(alpha, tasks, strict=True):
            way = TrajectoryDistribution.of_task(
                self.model, task, round_horizon=round_horizon, exact_ends=exact_ends
            )
            if not way.is_possible:
                continue
            legs, log_z = self._legs(way), float(way.log_z[0, way.start])
            for j in range(controls + 1):
                others = np.arange(regions + controls) == regions + j
                beside = log_avoidance_beside(
                    legs, way.reachable, way.goal, way.start, log_z, others
                )
                of_task[:-1, j] = np.exp(beside[:regions])
                if j < controls:
                    of_task[-1, j] = np.exp(beside[regions + j])
        return np.minimum(alpha, 1.0)

    def _legs(self, way: TrajectoryDistribution) -> list[Leg]:
        """The moves of each part of the way of a task."""
        ends, last = way.ends, way.steps - 1
        if ends is None:
            return [(self.moves, 0, way.steps)]
        of_goal = way.goal, ends.goal
        if last == 0:
            return [(self._to_states([only_paths(self.model, ends.start, *of_goal)]), 0, 1)]
        first = self._to_states([first_paths(self.model, ends.start)])
        cells = np.flatnonzero(way.reachable[-2])
        goal = self._to_states(list(last_paths(self.model, cells, *of_goal)))
        return [(first, 0, 1), (self.moves, 1, last), (goal, last, last + 1)]

    def _to_states(self, parts: Sequence[MovePaths]) -> MergedMoves:
        """Moves from or to states; none is merged with another."""
        held = np.concatenate([self._of_paths(action, path) for _, action, _, path in parts])
        moves = allowed_moves(self.model, parts)
        if self.with_regions:
            count = len(self.model.regions)
            held = np.hstack([moves.crosses(np.arange(len(held)), count), held])
        crosses = scipy.sparse.csr_matrix(held)
        return replace(
            moves,
            crossing_begins=crosses.indptr.astype(np.int64),
            crossing_region=crosses.indices.astype(np.int32),
        )

    def _of_paths(self, action: Ints, path: Floats) -> Bools:
        """(L, C) which hypotheses forbid moves by their actions (L,) and paths (L, K+1, n)."""
        middles = self.model.system.space.wrap(_middle(path))
        return self.hypotheses.holds(middles, self.model.actions[action])


def _labelled(
    model: TabularModel, hypotheses: ControlHypotheses, cells: Ints, with_regions: bool
) -> SingleMoves:
    """The moves of some cells, with the hypotheses that forbid them in the place of regions, or
    after these."""
    single = model.moves_of(cells)
    origins = model.move_origins(
        np.repeat(cells, model.moves), np.tile(np.arange(model.moves), len(cells))
    )
    controls = np.tile(model.actions[model.action], (len(cells), 1))
    if hypotheses.uses_states:
        path = rollout(model.system, origins, controls[:, None, :], model.dt, model.substeps)
        origins = model.system.space.wrap(_middle(path))
    held = hypotheses.holds(origins, controls)
    successor = np.where(single.allowed(model.truth), single.successor, -1)
    crosses = scipy.sparse.csr_matrix(held)
    if with_regions:
        crosses = scipy.sparse.hstack([single.crosses, crosses], format="csr")
    return SingleMoves(successor, single.reward, crosses)


def _middle(path: Floats) -> Floats:
    """(L, n) the states in the middle of paths (L, K+1, n) of even times."""
    last = path.shape[1] - 1
    return (path[:, last // 2] + path[:, (last + 1) // 2]) / 2
