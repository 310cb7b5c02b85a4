"""The ranking of hypotheses by the model that a config asks for, with its progress."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from experiments.config.settings import ModelSettings
from experiments.progress import begin
from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.models import Model
from mlci.preparation import infer
from mlci.rank_errors import RankErrors, infer_until_settled
from mlci.sampled.model import SampledModel


def ranked(
    settings: ModelSettings, model: Model, demonstrations: Sequence[Demonstration], **options: Any
) -> Inference:
    """Rank hypotheses; where paths are sampled, with more until the first ranks are settled.

    Args:
        settings: say how many ranks that are, and how many samples are not exceeded.
        model: tabular or sampled.
        demonstrations: N demonstrations.
        options: more of `mlci.preparation.infer`'s arguments.
    """
    asked = settings.sampling
    if asked is None or not isinstance(model, SampledModel):
        return infer(model, demonstrations, **options)
    first = min(asked.settle, len(settings.candidates))

    def attempted(samples: int, errors: RankErrors) -> None:
        settled = int(np.sum(errors.settled[np.argsort(errors.rank)[:first]]))
        if first:
            begin(f"{samples} samples a task settle {settled} of the first {first} ranks")

    def worked_on(done: int, of: int) -> None:
        begin(f"sampling paths of task {min(done + 1, of)} of {of}")

    return infer_until_settled(
        model,
        demonstrations,
        first=first,
        most=asked.most,
        progress=attempted,
        task_progress=worked_on,
        **options,
    )[0]
