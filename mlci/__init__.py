"""Maximum likelihood constraint inference on discretised continuous dynamics.

Notation. Arrays are indexed by these letters wherever a docstring gives a shape.

======  ====================  =========================================  ==============
letter  name in code          meaning                                    unit
======  ====================  =========================================  ==============
n, m    --                    number of state, control dimensions        --
x       state, states         continuous state, (..., n)                 rad, rad/s, ...
u       control, controls     continuous control, (..., m)               rad/s^2, ...
h       System.dynamics       time derivative of the state, (..., n)     unit of x / s
S       grid.size             number of grid cells (tabular states)      --
A       len(actions)          number of actions                          --
M       model.moves           moves of a cell: action x start point      --
W       --                    merged moves of all cells                  --
T       steps                 transitions of a tabular trajectory        --
K       --                    samples of a recorded path, less one       --
C       len(regions)          number of regions (hypotheses)             --
N       --                    number of demonstrations                   --
dt      dt                    time step of the tabular model             s
Z       log_z[t, s]           log partition function to go               nat
Phi     phi[i]                probability of violating region i          --
alpha   avoidance[j, i]       probability of avoiding i, 1 - Phi         --
D       violated[j, i]        demonstration j violates region i          --
L       gain[i]               log likelihood gain of region i            nat
V       values                safe set's value function                  unit of dist_K
======  ====================  =========================================  ==============
"""

from typing import TYPE_CHECKING, Any

from mlci.actuation.inference import ControlInference, calibrate_controls, infer_controls
from mlci.actuation.joint import JointInference, infer_joint
from mlci.actuation.predicates import ControlPredicates
from mlci.actuation.ranges import ControlRanges
from mlci.calibration import Calibration, calibrate
from mlci.cells.multilinear import MultilinearModel
from mlci.cells.refined_model import RefinedModel
from mlci.cells.refinement import refine
from mlci.crossings import Crossing
from mlci.demonstrations import Demonstration, Task
from mlci.demonstrator import demonstrate, sample_trials
from mlci.diagnosis import Diagnosis, diagnose
from mlci.exploration import explore
from mlci.forecasts import ForecastMap
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.mechanics.planar_chain import PlanarChain
from mlci.next_task import NextTask, next_tasks
from mlci.preparation import PreparedInference, infer, prepare
from mlci.rank_errors import RankErrors, infer_until_settled, rank_errors
from mlci.regions import Regions
from mlci.safety.joint_barrier import JointBarrier
from mlci.safety.reachability import SafeSet, solve_safe_set
from mlci.safety.safety_filter import SafetyFilter
from mlci.sampled.distribution import SampledDistribution
from mlci.sampled.model import SampledModel
from mlci.sampled.rare_regions import RareViolations, rare_violations
from mlci.sets.evidence import SetEvidence
from mlci.sets.inference import infer_sets
from mlci.sets.posterior import SetPosterior, SetPrior, enumerate_sets
from mlci.sets.sampling import sample_sets
from mlci.sets.search import Selection
from mlci.sets.selection import select_constraints, select_regions
from mlci.shapes.balls import Ball
from mlci.shapes.half_spaces import HalfSpace
from mlci.shapes.predicates import InTaskSpace, Predicate
from mlci.simulate import rollout
from mlci.soft.distribution import soften
from mlci.soft.weight import WeightEstimate, estimate_weights
from mlci.spaces import Box, StateSpace
from mlci.system_check import check_affine, check_system
from mlci.systems import (
    DoubleIntegrator,
    FunctionSystem,
    Pendulum,
    System,
    TelescopingPendulum,
)
from mlci.tabular import TabularModel, action_grid, discretize
from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.inference import TableInference, infer_table
from mlci.worlds.tables import Table, TablePath, TableRegion

if TYPE_CHECKING:
    from mlci.recordings.read import read_demonstrations
    from mlci.recordings.write import write_demonstration

__all__ = [
    "Ball",
    "Box",
    "Calibration",
    "CausalEntropy",
    "ControlInference",
    "ControlPredicates",
    "ControlRanges",
    "Crossing",
    "Demonstration",
    "Diagnosis",
    "DoubleIntegrator",
    "FirstExit",
    "FixedHorizon",
    "ForecastMap",
    "FunctionSystem",
    "Grid",
    "HalfSpace",
    "InTaskSpace",
    "Inference",
    "JointBarrier",
    "JointInference",
    "MultilinearModel",
    "NextTask",
    "Pendulum",
    "PlanarChain",
    "Predicate",
    "PreparedInference",
    "RankErrors",
    "RareViolations",
    "RefinedModel",
    "Regions",
    "SafeSet",
    "SafetyFilter",
    "SampledDistribution",
    "SampledModel",
    "Selection",
    "SetEvidence",
    "SetPosterior",
    "SetPrior",
    "StateSpace",
    "System",
    "Table",
    "TableInference",
    "TablePath",
    "TableRegion",
    "TabularModel",
    "Task",
    "TelescopingPendulum",
    "TrajectoryDistribution",
    "WeightEstimate",
    "action_grid",
    "calibrate",
    "calibrate_controls",
    "check_affine",
    "check_system",
    "demonstrate",
    "diagnose",
    "discretize",
    "enumerate_sets",
    "estimate_weights",
    "explore",
    "infer",
    "infer_controls",
    "infer_joint",
    "infer_sets",
    "infer_table",
    "infer_until_settled",
    "next_tasks",
    "prepare",
    "rank_errors",
    "rare_violations",
    "read_demonstrations",
    "refine",
    "rollout",
    "sample_sets",
    "sample_trials",
    "select_constraints",
    "select_regions",
    "soften",
    "solve_safe_set",
    "write_demonstration",
]

__version__ = "0.10.0"


def __getattr__(name: str) -> Any:
    """What reads and writes recordings; it needs pandas, which takes longer than all the rest."""
    if name == "read_demonstrations":
        from mlci.recordings.read import read_demonstrations

        return read_demonstrations
    if name == "write_demonstration":
        from mlci.recordings.write import write_demonstration

        return write_demonstration
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
