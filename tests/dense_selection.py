"""Scobee and Sastry's algorithm once more, with dense matrices and nothing of ours."""

from __future__ import annotations

from collections import Counter

import numpy as np
import scipy.linalg

STEPS = [(-1, 0), (1, 0), (0, 1), (0, -1), (-1, 1), (1, 1), (-1, -1), (1, -1)]
SIDE, REWARD = 9, -4.0

Move = tuple[int, int, int]  # state, action, next state


def moves() -> list[Move]:
    """Every move of the grid."""
    found = []
    for s in range(SIDE**2):
        y, x = divmod(s, SIDE)
        for a, (right, up) in enumerate(STEPS):
            if 0 <= x + right < SIDE and 0 <= y + up < SIDE:
                found.append((s, a, SIDE * (y + up) + x + right))
    return found


def hypotheses() -> dict[str, set[Move]]:
    """The moves that each hypothesis removes, in the published order."""
    every = moves()
    sets = {f"state {s}": {m for m in every if s in (m[0], m[2])} for s in range(SIDE**2)}
    sets |= {f"action {a}": {m for m in every if m[1] == a} for a in range(len(STEPS))}
    for name, states in (("green", {4, 13, 22}), ("blue", {58, 67, 76})):
        sets[name] = {m for m in every if states & {m[0], m[2]}}
    return sets


def log_z(left: set[Move], goal: int) -> np.ndarray:
    """log Z (S,) by a dense solve over the states from which a goal can be reached."""
    back, reached = {goal}, 0
    while len(back) > reached:
        reached = len(back)
        back |= {m[0] for m in left if m[2] in back}
    ends = np.full(SIDE**2, -np.inf)
    inner = sorted(back - {goal})
    place = {s: i for i, s in enumerate(inner)}
    matrix, out = np.eye(len(inner)), np.zeros(len(inner))
    for s, _, following in left:
        if s in place and following == goal:
            out[place[s]] += np.exp(REWARD)
        elif s in place and following in place:
            matrix[place[s], place[following]] -= np.exp(REWARD)
    if inner:
        ends[inner] = np.log(scipy.linalg.solve(matrix, out))
    ends[goal] = 0.0
    return ends


def select(
    paths: list[list[Move]], goal: int, least: float
) -> tuple[list[str], list[float], float]:
    """Names as they are added, KL before and after each, and the decrease of the next."""
    sets, left = hypotheses(), {m for m in moves() if m[0] != goal}
    used = {m for path in paths for m in path}
    feasible = [name for name, forbidden in sets.items() if not forbidden & used]
    counts = Counter(tuple(path) for path in paths)
    share = np.array(list(counts.values())) / len(paths)
    length = np.mean([len(path) for path in paths])
    fixed = float(np.sum(share * np.log(share)) - REWARD * length)

    def divergence(moves_left: set[Move]) -> float:
        values = log_z(moves_left, goal)
        return fixed + float(np.mean([values[path[0][0]] for path in paths]))

    kl, added = [divergence(left)], []
    while feasible:
        after = np.array([divergence(left - sets[name]) for name in feasible])
        best = int(np.argmax(after < np.min(after) + 1e-9))
        if kl[-1] - after[best] <= least:
            return added, kl, kl[-1] - after[best]
        kl.append(float(after[best]))
        added.append(feasible.pop(best))
        left = left - sets[added[-1]]
    return added, kl, 0.0


def sample(
    rng: np.random.Generator, start: int, goal: int, forbidden: set[Move], strength: float
) -> list[Move]:
    """A path that keeps out of what is forbidden: the more direct, the higher the strength."""
    left = [m for m in moves() if m not in forbidden]
    target = np.array(divmod(goal, SIDE))
    for _ in range(1000):
        state, path = start, list[Move]()
        while state != goal and len(path) < 60:
            options = [m for m in left if m[0] == state]
            if not options:
                break
            far = [np.max(np.abs(np.array(divmod(m[2], SIDE)) - target)) for m in options]
            weight = np.exp(-strength * np.array(far))
            path.append(options[rng.choice(len(options), p=weight / np.sum(weight))])
            state = path[-1][2]
        if state == goal:
            return path
    raise AssertionError("no path was drawn")
