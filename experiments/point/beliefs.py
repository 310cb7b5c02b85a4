"""What demonstrations say beside the ranking, where a config asks: of sets, controls and areas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.belief_lines import Beliefs
from experiments.config.settings import RecordedSettings
from experiments.point.area_shapes import area_belief, area_record, area_table
from experiments.point.controls import control_record, recorded_controls
from experiments.point.joint import MOST_ROWS, joint_belief, joint_record
from experiments.point.sets import set_belief, set_record
from experiments.progress import begin
from experiments.tracking.store import Store
from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.models import Model
from mlci.tabular import TabularModel


def belief_tables(beliefs: Beliefs) -> dict[str, pd.DataFrame]:
    """A table a belief that has one."""
    found = {}
    if beliefs.controls is not None:
        found["controls"] = beliefs.controls.to_frame()
    if beliefs.joint is not None:
        found["joint"] = beliefs.joint.to_frame().head(MOST_ROWS)
    if beliefs.area is not None:
        found["area"] = area_table(beliefs.area)
    return found


def belief_record(beliefs: Beliefs) -> dict[str, Any]:
    """All of them as JSON holds it."""
    sets, controls, joint, area = beliefs.sets, beliefs.controls, beliefs.joint, beliefs.area
    return {
        "sets": None if sets is None else set_record(sets, beliefs.names),
        "controls": None if controls is None else control_record(controls),
        "joint": None if joint is None else joint_record(joint),
        "area": None if area is None else area_record(area),
    }


def recorded_beliefs(
    settings: RecordedSettings,
    model: Model,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    exported: Store | None = None,
) -> Beliefs:
    """What is asked of recorded demonstrations beside the ranking of regions.

    Args:
        settings: what is asked; controls and areas are refused without cells.
        model: the model of the agent.
        demonstrations: the N demonstrations.
        inference: what they say of single regions.
        exported: as of `recorded_controls`.
    """
    begin("weighing sets of hypotheses")
    sets = set_belief(settings, model, demonstrations, inference, np.random.default_rng(0))
    controls = joint = area = None
    if isinstance(model, TabularModel):
        controls = recorded_controls(settings, model, demonstrations, exported)
        joint = joint_belief(settings, model, demonstrations, inference, controls)
        begin("weighing areas of one or two shapes")
        area = area_belief(settings, model, demonstrations, inference, np.random.default_rng(0))
    return Beliefs(inference.hypotheses.names, sets, controls, joint, area)
