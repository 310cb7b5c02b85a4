"""Kinds of evidence compared over simulated worlds, each weighed by its prior, with intervals."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.collate.finished import LAST_OPENING
from experiments.collate.intervals import TAILS, Floats, generator
from experiments.collate.reliability import EDGES, NO_TRUTH, set_resamples, weighted

PAPER, FIXED = "paper", "model error"  # the paper's evidence; how kinds with a fixed rate begin
_DECIMALS = 9  # of a probability that is put into a bin: what differs beyond is rounding
LEAST = 1e-10  # a posterior below counts as this, where its logarithm is averaged
CHANCES = 1000  # draws of what would be right if posteriors came true


def evidence_kinds(evidence: pd.DataFrame) -> pd.DataFrame:
    """How calibrated and how informative each kind of evidence is.

    Weights and intervals are those of `experiments.collate.reliability`. Differences are between
    kinds on the same demonstrations, so that their intervals are of paired worlds.

    Args:
        evidence: the collated table: opening columns up to `seed`, then `prior`, `sets`, `set`,
            `demonstrations`, `evidence`, `best`, `right`, `of_truth`, `top`, `feasible`.

    Returns:
        The opening columns but those of the truth and `seed`; `demonstrations`, `evidence`; number
        of `worlds` and `sets`; and with `_low` and `_high`: `off_by`, the mean distance between
        the posterior of the best hypothesis and how often it is right, over bins of the posterior,
        with `by_chance` and `by_chance_high`, the mean and the 95 % quantile of what it would be
        for as many sets if every posterior came true;
        `best`, `right`; `log_truth`, the mean log posterior of what is true, and `log_over_paper`
        and `log_over_fixed`, how much more that is than with the paper's evidence and with the best
        of the fixed rates; `top`, the share of truths among the first, and `top_over_paper`.
    """
    names = list(evidence.columns)
    opening = [name for name in names[: names.index(LAST_OPENING)] if not name.startswith("truth")]
    evidence = evidence.assign(world=evidence["truth"].astype(str))
    rows = []
    for key, group in evidence.groupby([*opening, "demonstrations"], sort=True, dropna=False):
        kinds = {str(kind): weighted(part) for kind, part in group.groupby("evidence", sort=False)}
        first = next(iter(kinds.values()))
        sets = np.asarray(first.groupby(["world", LAST_OPENING, "set"]).ngroup(), dtype=np.int64)
        counts = np.vstack(
            [np.ones(len(sets)), set_resamples(first, sets, list(map(str, key)))[:, sets]]
        )
        scores = {kind: _scores(part, counts) for kind, part in kinds.items()}
        fixed = [kind for kind in scores if kind.startswith(FIXED)]
        references = {"log_over_paper": ("log_truth", PAPER), "top_over_paper": ("top", PAPER)}
        if fixed:
            best = max(fixed, key=lambda kind: scores[kind]["log_truth"][0])
            references["log_over_fixed"] = ("log_truth", best)
        for kind, values in scores.items():
            for name, (score, reference) in references.items():
                values[name] = scores[kind][score] - scores[reference][score]
            row = dict(zip([*opening, "demonstrations"], key, strict=True))
            row |= {"evidence": kind, "worlds": first.groupby(["world", LAST_OPENING]).ngroups}
            row["sets"] = len(first)
            for name, drawn in values.items():
                low, high = np.nanquantile(drawn[1:], TAILS)
                row |= {name: drawn[0], f"{name}_low": low, f"{name}_high": high}
            chance = _off_by_chance(kinds[kind], [*map(str, key), kind])
            row |= {"by_chance": np.mean(chance), "by_chance_high": np.quantile(chance, 0.95)}
            rows.append(row)
    return pd.DataFrame(rows)


def _scores(rows: pd.DataFrame, counts: Floats) -> dict[str, Floats]:
    """Each score (1 + B,): over all sets, and over each resample.

    Args:
        rows: a row a set, with its weight.
        counts: (1 + B, S) how often each set counts.
    """
    weights = counts * rows["weight"].to_numpy()
    total = weights.sum(axis=1)
    best, right = rows["best"].to_numpy(), rows["right"].to_numpy()
    has_truth = (rows["world"] != NO_TRUTH).to_numpy()
    with np.errstate(invalid="ignore"):
        top = (weights[:, has_truth] @ rows["top"].to_numpy(dtype=float)[has_truth]) / weights[
            :, has_truth
        ].sum(axis=1)
    log_truth = np.log(np.maximum(rows["of_truth"].to_numpy(), LEAST))
    return {
        "off_by": _distance(weights, best, best - right) / total,
        "best": weights @ best / total,
        "right": weights @ right / total,
        "log_truth": weights @ log_truth / total,
        "top": top,
    }


def _off_by_chance(rows: pd.DataFrame, key: list[str]) -> Floats:
    """`off_by` (B,) where each best hypothesis is right as often as its posterior says."""
    weights, best = rows["weight"].to_numpy(), rows["best"].to_numpy()
    right = generator(key).random((CHANCES, len(best))) < best
    return _distance(weights, best, best - right) / weights.sum()


def _distance(weights: Floats, best: Floats, excess: Floats) -> Floats:
    """(B,) how far weighed excesses (S,) or (B, S) are from 0, over bins of the posterior."""
    place = np.searchsorted(EDGES, np.round(best, _DECIMALS), side="right")
    place = np.clip(place, 1, len(EDGES) - 1)
    weighed = weights * excess
    return sum(
        (np.abs(weighed[..., place == number].sum(axis=-1)) for number in np.unique(place)),
        start=np.zeros(len(weighed)),
    )
