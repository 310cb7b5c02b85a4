"""Every value of a config, in frozen dataclasses: its type, range, meaning and unit."""

from experiments.config.settings.advice import AdviceSettings
from experiments.config.settings.areas import AreaSettings
from experiments.config.settings.baselines import BaselineSettings
from experiments.config.settings.cells import GridSettings, TransitionSettings
from experiments.config.settings.control_predicates import PredicateSettings
from experiments.config.settings.controls import ControlHypothesesSettings, ControlRange
from experiments.config.settings.dynamics import DynamicsSettings
from experiments.config.settings.kinds import ESTIMATE
from experiments.config.settings.parts import (
    CalibrationSettings,
    DemonstrationSettings,
    InferenceSettings,
    NextTaskSettings,
    RankSettings,
    SetSettings,
    TaskBoxSettings,
    TaskSettings,
)
from experiments.config.settings.point import ModelSettings, Settings, SubjectSettings
from experiments.config.settings.reality import RealitySettings
from experiments.config.settings.recorded import RecordedSettings
from experiments.config.settings.regions import NO_TRUTH, HypothesesSettings, TruthSettings
from experiments.config.settings.safety import BARRIER, ESCAPES, SafetySettings
from experiments.config.settings.sampling import ModelsSettings, SampledSettings
from experiments.config.settings.shapes import (
    BallSettings,
    HalfSpaceSettings,
    Region,
    ShapeList,
    ShapeSettings,
)
from experiments.config.settings.study import RunSettings, StudySettings, SweepSettings
from experiments.config.settings.system import SystemSettings, system_class
from experiments.config.settings.world import TableSettings

__all__ = [
    "BARRIER",
    "ESCAPES",
    "ESTIMATE",
    "NO_TRUTH",
    "AdviceSettings",
    "AreaSettings",
    "BallSettings",
    "BaselineSettings",
    "CalibrationSettings",
    "ControlHypothesesSettings",
    "ControlRange",
    "DemonstrationSettings",
    "DynamicsSettings",
    "GridSettings",
    "HalfSpaceSettings",
    "HypothesesSettings",
    "InferenceSettings",
    "ModelSettings",
    "ModelsSettings",
    "NextTaskSettings",
    "PredicateSettings",
    "RankSettings",
    "RealitySettings",
    "RecordedSettings",
    "Region",
    "RunSettings",
    "SafetySettings",
    "SampledSettings",
    "SetSettings",
    "Settings",
    "ShapeList",
    "ShapeSettings",
    "StudySettings",
    "SubjectSettings",
    "SweepSettings",
    "SystemSettings",
    "TableSettings",
    "TaskBoxSettings",
    "TaskSettings",
    "TransitionSettings",
    "TruthSettings",
    "system_class",
]
