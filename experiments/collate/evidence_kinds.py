"""Kinds of evidence compared over simulated worlds, each weighed by its prior, with intervals."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.collate.finished import LAST_OPENING
from experiments.collate.intervals import TAILS, Floats
from experiments.collate.reliability import NO_TRUTH, set_resamples, weighted

PAPER, FIXED = "paper", "model error"  # the paper's evidence; how kinds with a fixed rate begin


def evidence_kinds(evidence: pd.DataFrame) -> pd.DataFrame:
    """How calibrated and how informative each kind of evidence is.

    Each set weighs as much as its world's prior, divided by the world's sets. Sets of a point share
    demonstrations, so that intervals are of a bootstrap that draws points anew, each with all its
    sets: worlds with a constraint, and points of the world without one. Differences are between
    kinds on the same demonstrations.

    Args:
        evidence: the collated table: opening columns up to `seed`, then `prior`, `sets`,
            `demonstrations`, `evidence`, `bin`, `count`, and of the sets in that bin the sums
            `best`, `right`, `log_truth`, `top`.

    Returns:
        The opening columns but those of the truth and `seed`; `demonstrations`, `evidence`; number
        of `worlds`, which are points, and `sets`; and with `_low` and `_high`: `off_by`, the mean
        distance between the posterior of the best hypothesis and how often it is right, over bins
        of the posterior; `best`, `right`; `log_truth`, the mean log posterior of what is true, and
        `log_over_paper` and `log_over_fixed`, how much more that is than with the paper's evidence
        and with the best of the fixed rates; `top`, the share of truths among the first, and
        `top_over_paper`. `by_chance` and `by_chance_high` are the mean and the 95 % quantile of how
        far other worlds, drawn from these, are off from these ones: so large `off_by` is where
        every bin is right as often as it says.
    """
    names = list(evidence.columns)
    opening = [name for name in names[: names.index(LAST_OPENING)] if not name.startswith("truth")]
    evidence = evidence.assign(world=evidence["truth"].astype(str))
    rows = []
    for key, group in evidence.groupby([*opening, "demonstrations"], sort=True, dropna=False):
        group = weighted(group)
        points = np.asarray(group.groupby(["world", LAST_OPENING]).ngroup(), dtype=np.int64)
        drawn = set_resamples(group, points, list(map(str, key)))
        counts = np.vstack([np.ones(drawn.shape[1]), drawn])[:, points]
        kind = group["evidence"].to_numpy()
        scores = {
            str(name): _scores(group[kind == name], counts[:, kind == name])
            for name in group["evidence"].unique()
        }
        fixed = [name for name in scores if name.startswith(FIXED)]
        references = {"log_over_paper": ("log_truth", PAPER), "top_over_paper": ("top", PAPER)}
        if fixed:
            best = max(fixed, key=lambda name: scores[name]["log_truth"][0])
            references["log_over_fixed"] = ("log_truth", best)
        for name, values in scores.items():
            chance = values.pop("by_chance")
            row = dict(zip([*opening, "demonstrations"], key, strict=True))
            row |= {"evidence": name, "worlds": drawn.shape[1]}
            row["sets"] = int(group.loc[kind == name, "count"].sum())
            for score, (of, reference) in references.items():
                values[score] = values[of] - scores[reference][of]
            for score, drawn_scores in values.items():
                low, high = np.nanquantile(drawn_scores[1:], TAILS)
                row |= {score: drawn_scores[0], f"{score}_low": low, f"{score}_high": high}
            row |= {"by_chance": np.mean(chance), "by_chance_high": np.quantile(chance, 0.95)}
            rows.append(row)
    return pd.DataFrame(rows)


def _scores(rows: pd.DataFrame, counts: Floats) -> dict[str, Floats]:
    """Each score (1 + B,): over all points, and over each resample; `by_chance` (B,).

    Args:
        rows: a row a point and bin, with the weight of each of its sets.
        counts: (1 + B, rows) how often the point of each row counts.
    """
    weights = counts * rows["weight"].to_numpy()
    has_truth = (rows["world"] != NO_TRUTH).to_numpy()
    count = rows["count"].to_numpy()
    total, with_truth = weights @ count, weights[:, has_truth] @ count[has_truth]
    best, right, log_truth = (rows[name].to_numpy() for name in ("best", "right", "log_truth"))
    place = rows["bin"].to_numpy()
    excess = np.stack(
        [
            weights[:, place == number] @ (best - right)[place == number] / total
            for number in np.unique(place)
        ]
    )
    with np.errstate(invalid="ignore"):
        top = weights[:, has_truth] @ rows["top"].to_numpy(dtype=float)[has_truth] / with_truth
    return {
        "off_by": np.sum(np.abs(excess), axis=0),
        "best": weights @ best / total,
        "right": weights @ right / total,
        "log_truth": weights @ log_truth / total,
        "top": top,
        "by_chance": np.sum(np.abs(excess[:, 1:] - excess[:, :1]), axis=0),
    }
