"""First step of a point: demonstrations, the tabular model, and what they say of the hypotheses."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from experiments.belief_lines import Beliefs
from experiments.config.settings import ESTIMATE, Settings
from experiments.point.area_shapes import area_belief
from experiments.point.controls import point_controls
from experiments.point.forecasts import forecast_calibration
from experiments.point.joint import joint_belief
from experiments.point.no_answer import NoAnswer, why_none
from experiments.point.ranking import ranked
from experiments.point.sets import set_belief
from experiments.point.stages import inference_model
from experiments.point.streams import Purpose, stream
from experiments.point.trials import TrialSet, demonstrations
from experiments.tracking.store import Store
from mlci.answers import Answer, answer
from mlci.calibration import Calibration
from mlci.demonstrations import Demonstration
from mlci.diagnosis import Diagnosis, diagnose
from mlci.inference import Inference
from mlci.models import Model
from mlci.spaces import Bools, Ints
from mlci.tabular import TabularModel


@dataclass(frozen=True, eq=False)
class PointInference:
    """What a point's demonstrations say of the hypotheses.

    Attributes:
        trials: all trials of the demonstrator.
        numbers: (N,) those trials that are demonstrations.
        demonstrations: (N,) the demonstrations.
        model: tabular or sampled; its regions are the hypotheses and the truth's boxes.
        hypotheses: (C',) mask over the model's regions.
        truth: (C',) mask over the model's regions: the truth's boxes.
        inference: from the N demonstrations about the C hypotheses.
        diagnosis: how cells move; None where there are none.
        calibration: how often the model's forecasts come true, where evidence is to be calibrated.
        beliefs: what is believed beside the ranking, where it is asked for.
    """

    trials: TrialSet
    numbers: Ints
    demonstrations: tuple[Demonstration, ...]
    model: Model
    hypotheses: Bools
    truth: Bools
    inference: Inference
    diagnosis: Diagnosis | None
    calibration: Calibration | None = None
    beliefs: Beliefs = field(default_factory=Beliefs)

    @property
    def tabular(self) -> TabularModel:
        """The model, which has cells.

        Raises:
            TypeError: it has none; `experiments.config` refuses what would ask for them.
        """
        if not isinstance(self.model, TabularModel):
            raise TypeError(f"this needs cells, which a {type(self.model).__name__} has not")
        return self.model

    @property
    def unreachable(self) -> int:
        """How many goals the model cannot reach."""
        return int(np.sum(~self.inference.reachable))


def infer_point(settings: Settings, store: Store) -> PointInference:
    """Run the demonstrator and rank the hypotheses.

    Raises:
        NoAnswer: no trial is a demonstration.
    """
    trials = demonstrations(settings, store)
    numbers = trials.kept(settings.demonstrations.keep)
    if not len(numbers):
        why = why_none(
            trials.outcome,
            trials.states,
            trials.miss,
            settings.model.space,
            settings.demonstrations.goal_tolerance,
        )
        raise NoAnswer(
            f"no demonstration was kept: {why}; narrow tasks, or allow "
            "more demonstrations.iterations, restarts or goal_weight, or horizon"
        )
    model = inference_model(settings, store)
    paths = tuple(
        trials.demonstration(number, settings.horizon, settings.demonstrations.dt)
        for number in numbers
    )
    hypotheses = model.regions.mask(settings.candidates.names)
    calibration = forecast_calibration(settings, store) if settings.inference.calibrate else None
    forecast_map = None if calibration is None else calibration.map
    inference = ranked(
        settings,
        model,
        paths,
        hypotheses=hypotheses,
        prior_none=settings.inference.prior,
        size_prior=settings.inference.size_prior,
        rates=settings.inference.rates(calibrated=forecast_map is not None),
        calibration=forecast_map,
        exact_ends=settings.inference.exact_ends,
        tolerance=np.inf,  # the demonstrator has decided which ends are near enough to the goal
    )
    if settings.inference.rule_breaking == ESTIMATE:
        inference = inference.with_rule_breaking()
    sets = set_belief(
        settings, model, paths, inference, stream(settings.seed, Purpose.SETS, 0), hypotheses
    )
    diagnosis = controls = joint = area = None
    if isinstance(model, TabularModel):
        diagnosis, controls = diagnose(model), point_controls(settings, store, model, paths)
        joint = joint_belief(settings, model, paths, inference, controls, hypotheses)
        of_areas = stream(settings.seed, Purpose.AREAS, 3)
        area = area_belief(settings, model, paths, inference, of_areas)
    return PointInference(
        trials=trials,
        numbers=numbers,
        demonstrations=paths,
        model=model,
        hypotheses=hypotheses,
        truth=model.regions.mask(settings.constraint.names),
        inference=inference,
        diagnosis=diagnosis,
        calibration=calibration,
        beliefs=Beliefs(inference.hypotheses.names, sets, controls, joint, area),
    )


def point_answer(settings: Settings, point: PointInference) -> Answer:
    """How to read what a point's demonstrations say."""
    return answer(
        point.model,
        point.demonstrations,
        point.inference,
        hypotheses=point.hypotheses,
        exact_ends=settings.inference.exact_ends,
        samples=settings.misfit,
        simulated=() if point.calibration is None else point.calibration.excess,
    )
