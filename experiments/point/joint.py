"""A region, a limit of the controls, or both at once: belief, tables and record of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.config.settings import ModelSettings, Settings
from experiments.point.controls import against_truth
from experiments.progress import begin
from mlci.actuation.inference import ControlInference
from mlci.actuation.joint import KINDS, NOTHING, JointInference, infer_joint
from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.json_numbers import finite
from mlci.metrics import random_subsets
from mlci.spaces import Bools
from mlci.tabular import TabularModel

MOST_ROWS = 200  # of the table of pairs
_COLUMNS = dict(zip(KINDS, ("nothing", "region", "controls", "both"), strict=True))


def joint_belief(
    settings: ModelSettings,
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    controls: ControlInference | None,
    hypotheses: Bools | None = None,
) -> JointInference | None:
    """What demonstrations say of pairs; None where nobody asks. No calibration tells of pairs.

    Args:
        settings: the priors and the model error.
        model: the tabular model.
        demonstrations: the N demonstrations.
        inference: what they say of regions.
        controls: what they say of ranges.
        hypotheses: (C',) mask over the model's regions; all by default.
    """
    both = settings.hypotheses.controls.both
    if controls is None or not both:
        return None
    begin("weighing regions and controls at once")
    some = 1 - settings.inference.prior
    alone = some * (1 - both) / 2
    return infer_joint(
        model,
        demonstrations,
        inference,
        controls,
        kinds=(1 - some, alone, alone, some * both),
        rates=settings.inference.rates(calibrated=False),
        hypotheses=hypotheses,
        exact_ends=settings.inference.exact_ends,
        round_horizon=True,
    )


def joint_tables(
    settings: Settings, joint: JointInference, regions: Bools, rng: np.random.Generator
) -> dict[str, pd.DataFrame]:
    """`joint`, a row a pair; `joint_ranks`, a row a random subset of the demonstrations.

    Args:
        settings: the point.
        joint: the belief.
        regions: (C,) which hypotheses are inside of the true regions.
        rng: of the subsets.

    Returns:
        `joint` has the columns of `JointInference.to_frame`, and `is_truth`. `joint_ranks` has
        `demonstrations`, their number; `subset`; the `region` and `controls` of the most probable
        pair; the posterior of each kind, `nothing`, `region_alone`, `controls_alone` and `both`,
        and of the true pairs, `posterior`; whether the most probable pair is true (`true_first`),
        its region (`true_region`) and its controls (`true_controls`); nan where no pair is.
    """
    truths = true_pairs(settings, regions)
    known, of_region, of_controls = truths.any(), np.any(truths, axis=1), np.any(truths, axis=0)
    ranks, rows = settings.ranks, []
    for subsets in random_subsets(len(joint.avoidance), ranks.demonstrations, ranks.subsets, rng):
        for number, subset in enumerate(subsets):
            belief = joint.of_some(subset)
            posterior = belief.posterior
            i, j = map(int, np.unravel_index(np.argmax(posterior), posterior.shape))
            kinds = dict(zip(_COLUMNS.values(), belief.of_kinds.tolist(), strict=True))
            right = {
                "posterior": np.sum(posterior[truths]),
                "true_first": truths[i, j],
                "true_region": np.asarray(of_region)[i],
                "true_controls": np.asarray(of_controls)[j],
            }
            rows.append(
                {
                    "demonstrations": len(subset),
                    "subset": number,
                    "first_region": joint.regions[i],
                    "first_controls": joint.controls[j],
                    **{f"of_{name}": value for name, value in kinds.items()},
                    **{name: float(value) if known else np.nan for name, value in right.items()},
                }
            )
    frame, names = joint.to_frame(), (joint.regions, joint.controls)
    place = [
        [names[axis].index(name) for name in frame[column]]
        for axis, column in enumerate(("region", "controls"))
    ]
    frame["is_truth"] = truths[place[0], place[1]]
    return {"joint": frame.head(MOST_ROWS), "joint_ranks": pd.DataFrame(rows)}


def true_pairs(settings: Settings, regions: Bools) -> Bools:
    """(C + 1, J + 1) pairs that are all that is forbidden; a region inside of the truth counts."""
    of_controls = against_truth(settings)[0]
    axes = []
    for forbidden, mask in (
        (len(settings.constraint) > 0, regions),
        (bool(settings.truth.controls), of_controls),
    ):
        axes.append(np.append(mask & forbidden, not forbidden))
    return np.asarray(axes[0][:, None] & axes[1][None, :])


def joint_record(joint: JointInference) -> dict[str, Any]:
    """The belief for programs, fit for JSON; None is no region, or no controls."""
    rows = [
        {
            "region": None if row["region"] == NOTHING else row["region"],
            "controls": None if row["controls"] == NOTHING else row["controls"],
            "gain": finite(row["gain"]),
            "posterior": row["posterior"],
        }
        for row in joint.to_frame().head(MOST_ROWS).to_dict("records")
    ]
    kinds = dict(zip(_COLUMNS.values(), joint.of_kinds.tolist(), strict=True))
    return {"kinds": kinds, "pairs": rows}
