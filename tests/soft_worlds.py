"""Small worlds with a region that may be entered at a cost, and all their trajectories."""

import itertools

import numpy as np
from toy_models import toy_model

from mlci.soft.distribution import SoftModel
from mlci.spaces import Floats


def toy_world(seed: int) -> SoftModel:
    """Five cells, three moves; moves into cell 3 or out of it are inside for some time."""
    rng = np.random.default_rng(seed)
    successor = rng.integers(0, 5, size=(5, 3))
    successor[:, 0], successor[0, 1] = np.arange(5), 3
    successor[:, 2] = successor[:, 1]  # one successor: to be merged only if the times agree
    inside = (successor == 3) | (np.arange(5)[:, None] == 3)
    times = np.where(inside, rng.choice([0.25, 0.5, 1.0], size=(5, 3)), 0.0)
    crosses = np.stack([inside.ravel(), rng.random(15) < 0.3], axis=1)
    model = toy_model(successor, rng.normal(size=(5, 3)), np.ones((5, 3), bool), crosses)
    return SoftModel(model, 0, times)


def enumerated(soft: SoftModel, steps: int, goals: list[int]) -> tuple[Floats, Floats, Floats]:
    """Reward, time inside and whether region 1 is crossed, of each trajectory to a goal."""
    kept = soft.model.kept
    crosses = kept.crosses.toarray().reshape(*soft.times.shape, -1)
    rows = []
    for moves in itertools.product(range(soft.model.moves), repeat=steps):
        cell, row = 0, np.zeros(3)
        for move in moves:
            row += [kept.reward[cell, move], soft.times[cell, move], crosses[cell, move, 1]]
            cell = kept.successor[cell, move]
        if cell in goals:
            rows.append(row)
    reward, time, crossed = np.array(rows).T
    return reward, time, crossed > 0
