"""Belief over sets of hypotheses, where a config asks for it: its table and its record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from experiments.config.settings import ModelSettings
from mlci.credible_sets import neighbours
from mlci.demonstrations import Demonstration
from mlci.evidence import Rates
from mlci.inference import Inference
from mlci.json_numbers import finite
from mlci.models import Model
from mlci.sets.inference import infer_sets
from mlci.sets.posterior import SetPosterior, SetPrior
from mlci.spaces import Bools

MOST_ROWS = 1000  # of a table of sets


def set_belief(
    settings: ModelSettings,
    model: Model,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    rng: np.random.Generator,
    hypotheses: Bools | None = None,
) -> SetPosterior | None:
    """What demonstrations say of sets; None where no set is asked for.

    A calibration says nothing of sets, so that evidence is that of the model error.

    Args:
        settings: say how large a set may be.
        model: the model.
        demonstrations: the N demonstrations.
        inference: what they say of each hypothesis.
        rng: for a sample.
        hypotheses: (C',) mask over the model's regions; None takes all.
    """
    sets = settings.inference.sets
    if not sets.largest:
        return None
    touching = neighbours(inference.hypotheses) if sets.adjacency else None
    prior = SetPrior.geometric(
        settings.inference.prior, sets.further, sets.largest, sets.adjacency, touching
    )
    rates = Rates(settings.inference.model_error, inference.rates.rule_breaking)
    return infer_sets(
        model,
        demonstrations,
        replace(inference, calibration=None, rates=rates),
        prior,
        rng=rng,
        steps=sets.steps,
        hypotheses=hypotheses,
        exact_ends=settings.inference.exact_ends,
    )


def set_tables(sets: SetPosterior) -> dict[str, pd.DataFrame]:
    """`sets`, a row a set, the most probable first; `set_marginals`, a row a hypothesis."""
    numbers = list(map(str, range(sets.members.shape[1])))
    frame = sets.to_frame(numbers).head(MOST_ROWS)
    check = sets.check
    return {
        "sets": frame.rename(columns={"set": "hypotheses"}),
        "set_marginals": pd.DataFrame(
            {
                "hypothesis": np.arange(len(numbers)),
                "marginal": sets.marginal,
                "standard_error": 0.0 if check is None else check.standard_error[:-1],
                "r_hat": np.nan if check is None else check.r_hat[:-1],
            }
        ),
    }


def set_record(sets: SetPosterior, names: Sequence[str]) -> dict[str, Any]:
    """The belief for programs, fit for JSON."""
    check, best = sets.check, sets.most_probable()
    return {
        "most_probable": {
            "regions": [names[i] for i in best],
            "probability": sets.probability_of(best),
        },
        "none": sets.none,
        "sizes": np.trim_zeros(sets.sizes, "b").tolist(),
        "marginals": dict(zip(names, sets.marginal.tolist(), strict=True)),
        "credible_regions": [names[i] for i in sets.credible_regions()],
        "sampled": None
        if check is None
        else {
            "largest_r_hat": finite(np.max(check.r_hat)),
            "effective_samples": float(np.min(check.effective)),
            "standard_errors": dict(zip(names, check.standard_error[:-1].tolist(), strict=True)),
        },
    }
