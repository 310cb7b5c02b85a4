"""Whether what is believed with probability p is so in a share p of simulated worlds.

A world has one hypothesis for its truth, or none, as often as the prior says. In it, demonstrations
are shown from two sources. Those of the `demonstrator` are the study's own; how far off the
posterior is for them is the error of the tabular model. Those of the `model` are drawn from the
tabular model under the truth, and for them the posterior must be exactly calibrated, or a formula
is wrong. For that, tasks must tell nothing of the truth: a set's tasks are drawn without regard to
it, and a set with a task that cannot be solved under the truth shows nothing, but counts as drawn.
(Whoever drew such tasks anew would see more of the tasks that the truth allows, and the posterior,
which takes tasks as given, would be off.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from mlci.inference import confidence, printed_confidence, rank_constraints
from mlci.maxent import expected_violations, log_partition, sample_moves
from mlci.simulate import step_count
from mlci.spaces import Bools, Floats
from mlci.tabular import TabularMDP, forbid

# Probabilities are counted between these; most hypotheses are unlikely, so the first are narrow.
EDGES = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
_STREAM = 2  # beside those of experiments.point.run
_DRAWS = 1000  # of a task until one can be solved


@dataclass(frozen=True, eq=False)
class Shown:
    """Demonstrations in the order in which they are seen.

    Attributes:
        phi: (N, C) violation probabilities without a constraint, 0 where not reachable.
        violated: (N, C) what they violate.
        reachable: (N,) whether the tabular model can follow them.
    """

    phi: Floats
    violated: Bools
    reachable: Bools

    def first(self, count: int) -> Shown:
        """The first of them."""
        return Shown(self.phi[:count], self.violated[:count], self.reachable[:count])


def calibration_table(
    settings: Settings, mdp: TabularMDP, hypotheses: int, shown: Shown
) -> pd.DataFrame:
    """What is believed of one world, counted by how probable it is believed to be.

    Args:
        settings: the point; its truth is one hypothesis, or nothing.
        mdp: its tabular model, whose first regions are the hypotheses, and then the truth.
        hypotheses: C.
        shown: the study's own demonstrations.

    Returns:
        A row a source, set, number of demonstrations, kind of belief and bin: `prior` of the
        world; how many `sets` were drawn; how many beliefs fell into the bin (`count`), the sum of
        their probabilities (`predicted`), and how many were right (`hits`).
    """
    cell, wanted = settings.truth.cell, settings.calibration
    truth = np.arange(hypotheses) == (-1 if cell is None else cell)
    prior_none = settings.inference.prior
    world = {"prior": prior_none if cell is None else (1 - prior_none) / hypotheses}
    longest = max(wanted.demonstrations)
    own = [
        Shown(*(part[first : first + longest] for part in vars(shown).values()))
        for first in range(0, len(shown.phi) - longest + 1, longest)
    ]
    constrained = forbid(mdp, np.arange(hypotheses, mdp.crosses.shape[1]))
    drawn = [
        _drawn_set(settings, mdp, constrained, hypotheses, number) for number in range(wanted.sets)
    ]
    rows = []
    for source, sets in (("demonstrator", own), ("model", drawn)):
        for number, of_set in enumerate(sets):
            for count in wanted.demonstrations:
                if count > len(of_set.phi):
                    continue
                opening = {"source": source, **world, "sets": len(sets), "set": number}
                for belief, probability, right in _beliefs(of_set.first(count), truth, prior_none):
                    for counted in _binned(probability, right):
                        rows.append(
                            {**opening, "demonstrations": count, "belief": belief, **counted}
                        )
    return pd.DataFrame(rows)


def _beliefs(shown: Shown, truth: Bools, prior_none: float) -> Iterator[tuple[str, Floats, Bools]]:
    """Each kind of belief: its name, probabilities and whether each is right.

    `each` is the exact posterior of every hypothesis, and `none` that there is no constraint. The
    others are of the most likely hypothesis: its exact posterior (`selected`), and (12), corrected
    and as printed, with P(C) as the paper means it, the probability that there is a constraint.
    """
    phi = shown.phi[shown.reachable]
    ranking = rank_constraints(phi, shown.violated, prior_none)
    yield "each", ranking.posterior, truth
    yield "none", np.array([ranking.posterior_none]), np.array([not truth.any()])
    best = int(ranking.order[0])
    if not ranking.feasible[best]:
        return
    right = truth[[best]]
    yield "selected", ranking.posterior[[best]], right
    yield "corrected", np.array([confidence(1 - prior_none, phi[:, best])]), right
    yield "printed", np.array([printed_confidence(1 - prior_none, phi[:, best])]), right


def _binned(probability: Floats, right: Bools) -> Iterator[dict[str, float]]:
    """Counts of each bin that holds something; 0 is below 0, and one more than the last above 1."""
    place = np.searchsorted(EDGES, probability, side="right")
    place = np.where(probability == EDGES[-1], len(EDGES) - 1, place)
    for number in np.unique(place):
        inside = place == number
        yield {
            "bin": int(number),
            "count": int(np.sum(inside)),
            "predicted": float(np.sum(probability[inside])),
            "hits": int(np.sum(right[inside])),
        }


def _drawn_set(
    settings: Settings, mdp: TabularMDP, constrained: TabularMDP, hypotheses: int, number: int
) -> Shown:
    """Demonstrations from the tabular model under the truth, up to the first that there is not."""
    steps, grid = step_count(settings.horizon, settings.dt), settings.cells
    box = settings.tasks.start_box(grid.space)
    world = 0 if settings.truth.cell is None else settings.truth.cell + 1
    rng = np.random.default_rng(
        np.random.SeedSequence(settings.seed, spawn_key=(_STREAM, world, number))
    )
    phi, violated = [], []
    for _ in range(max(settings.calibration.demonstrations)):
        for _ in range(_DRAWS):
            start, goal = grid.index(rng.uniform(box.lower, box.upper, (2, len(box.lower))))
            (chance,), (reachable,) = expected_violations(mdp, [start], [goal], [steps])
            if reachable:
                break
        else:
            raise RuntimeError(
                f"none of {_DRAWS} tasks can be solved by the tabular agent: take a longer time "
                "step, more cells or transition.samples=3"
            )
        log_z = log_partition(constrained, start, goal, steps)
        if log_z[0, start] == -np.inf:
            break
        cells, moves = sample_moves(constrained, log_z, start, 1, rng)
        rows = cells[0, :-1] * mdp.moves + moves[0]
        violated.append(np.asarray(mdp.crosses[rows, :hypotheses].sum(axis=0)).ravel() > 0)
        phi.append(chance[:hypotheses])
    shape = (len(phi), hypotheses)
    return Shown(
        np.reshape(phi, shape), np.reshape(violated, shape).astype(bool), np.ones(len(phi), bool)
    )
