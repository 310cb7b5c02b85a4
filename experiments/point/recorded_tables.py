"""Tables of recorded demonstrations, and of what they say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.spaces import Bools, Floats


def path_table(demonstrations: Sequence[Demonstration], names: Sequence[str]) -> pd.DataFrame:
    """A row a sample of each demonstration."""
    samples = np.concatenate([demonstration.states for demonstration in demonstrations])
    lengths = [len(demonstration.states) for demonstration in demonstrations]
    of = np.repeat([demonstration.name for demonstration in demonstrations], lengths)
    return pd.DataFrame({"demonstration": of, **dict(zip(names, samples.T, strict=True))})


def demonstration_tables(
    demonstrations: Sequence[Demonstration], inference: Inference
) -> dict[str, pd.DataFrame]:
    """What each demonstration is, and what it says of each hypothesis."""
    count, names = len(inference.hypotheses), list(inference.names)
    phi = np.where(inference.reachable[:, None], inference.phi, np.nan)
    return {
        "demonstrations": pd.DataFrame(
            {
                "demonstration": names,
                "duration": [demonstration.task.horizon for demonstration in demonstrations],
                "reachable": inference.reachable,
                "violated": np.sum(inference.violated, axis=1),
            }
        ),
        "violations": pd.DataFrame(
            {
                "demonstration": np.repeat(names, count),
                "hypothesis": np.tile(np.arange(count), len(names)),
                "probability": phi.ravel(),
                "violated": inference.violated.ravel(),
                **_error_columns(inference),
            }
        ),
    }


def _error_columns(inference: Inference) -> dict[str, Floats | Bools]:
    """Standard errors of sampled probabilities, and which are told from 0 and 1; else nothing."""
    sampling = inference.sampling
    if sampling is None:
        return {}
    resolved = ~sampling.unresolved(inference.avoidance)
    return {"error": sampling.errors.ravel(), "resolved": resolved.ravel()}
