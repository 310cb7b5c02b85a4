"""What an answer is worth, where the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments.field.entries import Answer, Case
from mlci.evidence import rank_scores
from mlci.spaces import Bools, Floats

SURE = 1e-6  # probabilities count as at least so far from 0 and 1

# Each score: how a table calls it, and whether more of it is better.
SCORES = {
    "iou": ("IoU", True),
    "precision": ("precision", True),
    "recall": ("recall", True),
    "rank": ("rank of the best true one", False),
    "top": ("true among the first k", True),
    "log_posterior": ("log posterior of the truth [nat]", True),
    "calibration": ("claimed - true of the first", None),
    "violations": ("violations when deployed", False),
    "reward_lost": ("reward lost [nat]", False),
    "stuck": ("tasks without a way", False),
    "seconds": ("time [s]", False),
}


def score(case: Case, answer: Answer, rng: np.random.Generator) -> dict[str, float]:
    """The scores of an answer by name; nan where it has none.

    Args:
        case: the world and its truth.
        answer: what a method says of it.
        rng: breaks ties among the first hypotheses.
    """
    truth, count = case.truth, int(np.sum(case.truth))
    first = _first(answer.scores, count, rng)
    chosen = first if answer.chosen is None else answer.chosen
    both = float(np.sum(case.cover[chosen]))
    either = both + float(np.sum(1 - case.cover[chosen])) + float(np.sum(case.cover[~chosen]))
    rank = rank_scores(answer.scores, answer.scores > -np.inf)
    return {
        "iou": both / either if either else 1.0,
        "precision": both / max(int(np.sum(chosen)), 1),
        "recall": both / max(float(np.sum(case.cover)), SURE),
        "rank": float(np.min(rank[truth], initial=len(truth))),
        "top": float(np.sum(first & truth) / max(count, 1)),
        "log_posterior": _log_posterior(answer.probability, truth),
        "calibration": _overclaimed(answer, truth),
        **_deployed(case, chosen),
    }


def _first(scores: Floats, count: int, rng: np.random.Generator) -> Bools:
    """(C,) the hypotheses that come first; ties are broken at random, what is excluded left out."""
    order = np.lexsort((rng.random(len(scores)), -scores))[:count]
    return np.isin(np.arange(len(scores)), order[scores[order] > -np.inf])


def _log_posterior(probability: Floats | None, truth: Bools) -> float:
    """Log probability of the truth by the marginals, as if hypotheses were independent [nat]."""
    if probability is None:
        return np.nan
    sure = np.clip(probability, SURE, 1 - SURE)
    return float(np.sum(np.log(np.where(truth, sure, 1 - sure))))


def _overclaimed(answer: Answer, truth: Bools) -> float:
    """Probability that the first hypothesis is said to have, less whether it is true."""
    if answer.probability is None and answer.claimed is None:
        return np.nan
    best = int(np.argmax(answer.scores))
    claimed = answer.claimed
    if claimed is None:
        assert answer.probability is not None
        claimed = float(answer.probability[best])
    return claimed - float(truth[best])


def _deployed(case: Case, chosen: Bools) -> dict[str, float]:
    """What an agent does who takes the chosen hypotheses for forbidden, a mean over the tasks.

    Its reward is compared with that of an agent who knows which moves are forbidden.
    """
    violations: list[float] = []
    lost: list[float] = []
    stuck: list[float] = []
    for agent, _ in case.problem.tasks:
        allowed = agent.table.allowed & ~case.forbidden.reshape(agent.table.reward.shape)
        best = replace(agent, table=replace(agent.table, allowed=allowed))
        inferred = agent.under(chosen)
        if not (best.is_possible and agent.is_possible):
            continue  # the table cannot do what the demonstrator did
        stuck.append(float(not inferred.is_possible))
        if inferred.is_possible:
            violations.append(1 - inferred.keeps_out(case.forbidden))
            lost.append(best.expected_reward - inferred.expected_reward)
    each = {"violations": violations, "reward_lost": lost, "stuck": stuck}
    return {name: float(np.mean(some)) if some else np.nan for name, some in each.items()}
