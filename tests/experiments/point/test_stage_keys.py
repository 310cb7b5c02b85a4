"""Every field of a point's settings against the keys of the stages that points share.

A field that is missing in a key makes points share what is not theirs; one too many makes them
compute again what they could share. Each change below is of one field, and says what it makes anew.
"""

from __future__ import annotations

import pytest
from tiny_point import composed

from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point import forecasts, stages, trials
from experiments.tracking.trees import canonical_json, flatten, plain

BASE = ["grid.shape=[6,5]", "safety.shape=[21,21]"]
BALL = "[{center: [3.4, 0.6], radii: [0.3, 0.6]}]"
HALF_SPACE = "[{normal: [0.0, 1.0], offset: 1.5}]"
SHAPE = "[{_target_: mlci.shapes.half_spaces.HalfSpace, normal: [0.0, 1.0], offset: 1.5}]"
BOX = "[{lower: [3.2, 0.0], upper: [3.8, 1.2]}]"
PREDICATE = "[{_target_: toy_models.hard_push, above: 1.0}]"
RANGE = "[{lower: [1.0], upper: [null]}]"
ALL = {"safe_set", "demonstrations", "mdp", "mdp_truth", "forecasts"}
TRUTH, MODEL = {"safe_set", "demonstrations", "mdp_truth"}, {"mdp", "mdp_truth", "forecasts"}
REAL: set[str] = {"demonstrations"}
DEMONSTRATOR, FORECASTS = REAL | {"forecasts"}, {"forecasts"}
NOTHING: set[str] = set()
# A change of each field, and the stages that are made anew by it.
CHANGES = {
    "system.target": ("system._target_=mlci.systems.DoubleIntegrator", ALL),
    "system.arguments.speed_limit": ("system.speed_limit=5.0", ALL),
    "system.arguments.control_limit": ("system.control_limit=1.5", ALL),
    "system.arguments.gravity": ("system.gravity=2.0", ALL),
    "system.arguments.length": ("system.length=2.0", ALL),
    "system.arguments.drag": ("system.drag=0.1", ALL),
    "system.arguments.mass": ("system.mass=2.0", ALL),
    "actions": ("actions=5", MODEL),
    "action_range": ("action_range=[[-6.0,6.0]]", MODEL),
    "hypotheses.shape": ("hypotheses.shape=[10,20]", {"mdp", "forecasts"}),
    "hypotheses.grids": ("hypotheses.grids=[[null,5]]", {"mdp", "forecasts"}),
    "hypotheses.boxes": (f"hypotheses.boxes={BOX}", {"mdp", "forecasts"}),
    "hypotheses.balls": (f"hypotheses.balls={BALL}", {"mdp", "forecasts"}),
    "hypotheses.half_spaces": (f"hypotheses.half_spaces={HALF_SPACE}", {"mdp", "forecasts"}),
    "hypotheses.controls.ranges": (f"hypotheses.controls.ranges={RANGE}", NOTHING),
    "hypotheses.controls.shares": ("hypotheses.controls.shares=[0.5]", NOTHING),
    "hypotheses.controls.predicates": (f"hypotheses.controls.predicates={PREDICATE}", NOTHING),
    "hypotheses.controls.both": ("hypotheses.controls={both:0.2,shares:[0.5]}", NOTHING),
    "hypotheses.controls.tolerance": ("hypotheses.controls.tolerance=0.1", NOTHING),
    "hypotheses.shapes": (f"hypotheses.shapes={SHAPE}", {"mdp", "forecasts"}),
    "grid.shape": ("grid.shape=[6,7]", MODEL),
    "grid.offset": ("grid.offset=[0.5,0.0]", MODEL),
    "grid.refined": ("grid.refined=40", MODEL),
    "dt": ("dt=0.5", MODEL),
    "transition.samples": ("transition.samples=2", MODEL),
    "temperature": ("temperature=2.0", MODEL),
    "inference.prior": ("inference.prior=0.3", NOTHING),  # after all stages, as below
    "inference.exact_ends": ("inference.exact_ends=false", FORECASTS),
    "inference.calibrate": ("inference.calibrate=false", NOTHING),
    "inference.model_error": ("inference.model_error=0.2", NOTHING),
    "inference.rule_breaking": ("inference.rule_breaking=0.2", NOTHING),
    "inference.size_prior": ("inference.size_prior=1.0", NOTHING),
    "inference.sets.largest": ("inference.sets.largest=2", NOTHING),
    "inference.sets.further": ("inference.sets.further=0.5", NOTHING),
    "inference.sets.adjacency": ("inference.sets.adjacency=0.5", NOTHING),
    "inference.shapes.count": ("inference.shapes.count=9", NOTHING),
    "inference.shapes.kind": ("inference.shapes.kind=boxes", NOTHING),
    "inference.shapes.smallest": ("inference.shapes.smallest=0.1", NOTHING),
    "inference.shapes.largest": ("inference.shapes.largest=0.3", NOTHING),
    "inference.shapes.pair": ("inference.shapes.pair=0.5", NOTHING),
    "inference.shapes.apart": ("inference.shapes.apart=true", NOTHING),
    "inference.shapes.samples": ("inference.shapes.samples=9", NOTHING),
    "inference.sets.steps": ("inference.sets.steps=100", NOTHING),
    "tasks.lower": ("tasks.lower=[null,-1.0]", DEMONSTRATOR),
    "tasks.upper": ("tasks.upper=[null,1.0]", DEMONSTRATOR),
    "tasks.goal": ("tasks.goal=[0.1,null]", DEMONSTRATOR),
    "tasks.crossing": ("tasks.crossing=true", REAL),
    "truth.name": ("truth.name=another", NOTHING),  # a word in tables
    "truth.boxes": ("truth.boxes=[{lower: [3.1, 0.0], upper: [3.9, 1.2]}]", TRUTH),
    "truth.balls": (f"truth.balls={BALL}", TRUTH),
    "truth.half_spaces": (f"truth.half_spaces={HALF_SPACE}", TRUTH),
    "truth.shapes": (f"truth.shapes={SHAPE}", TRUTH),
    "truth.cell": ("truth=cell truth.cell=37", TRUTH),
    "truth.controls": ("truth=weak_push", TRUTH),
    "horizon": ("horizon=4.0", DEMONSTRATOR),
    "demonstrations.pairs": ("demonstrations.pairs=90", REAL),
    "demonstrations.keep": ("demonstrations.keep=60", NOTHING),  # of those that are stored
    "demonstrations.dt": ("demonstrations.dt=0.02", DEMONSTRATOR),
    "demonstrations.goal_tolerance": ("demonstrations.goal_tolerance=0.1", DEMONSTRATOR),
    "demonstrations.restarts": ("demonstrations.restarts=2", DEMONSTRATOR),
    "demonstrations.iterations": ("demonstrations.iterations=9", DEMONSTRATOR),
    "demonstrations.goal_weight": ("demonstrations.goal_weight=200.0", DEMONSTRATOR),
    "demonstrations.hold": ("demonstrations.hold=0.4", DEMONSTRATOR),
    "demonstrations.clip": ("demonstrations.clip=true", DEMONSTRATOR),
    "demonstrations.integrator": ("demonstrations.integrator=rk4", DEMONSTRATOR),
    "demonstrations.wind": ("demonstrations.wind=false", DEMONSTRATOR),
    "demonstrations.rule_breaking": ("demonstrations.rule_breaking=0.1", REAL),
    "reality.system": ("reality.system={length: 2.0}", {"safe_set", "demonstrations"}),
    "reality.effort": ("reality.effort=[0.0,1.0,0.0]", REAL),
    "reality.iterations": ("reality.iterations=2", REAL),
    "reality.integrator": ("reality.integrator=rk4", REAL),
    "reality.control_noise": ("reality.control_noise=[0.1]", REAL),
    "reality.sensor_noise": ("reality.sensor_noise=[0.1,0.1]", REAL),
    "safety.method": ("safety.method=escapes", {"safe_set", "demonstrations"}),
    "safety.shape": ("safety.shape=[23,21]", {"safe_set", "demonstrations"}),
    "safety.margin": ("safety.margin=0.1", REAL),
    "safety.width": ("safety.width=0.1", REAL),
    "safety.braking": ("safety.braking=5.0", REAL),
    "ranks.demonstrations": ("ranks.demonstrations=10", NOTHING),  # after all stages, as below
    "ranks.subsets": ("ranks.subsets=10", NOTHING),
    "ranks.top": ("ranks.top=3", NOTHING),
    "calibration.sets": ("truth=none calibration.sets=3", TRUTH),  # with another truth, see there
    "calibration.demonstrations": ("calibration.demonstrations=[1]", NOTHING),
    "baselines.paths": ("baselines.paths=7", NOTHING),
    "next_task.repetitions": ("next_task.repetitions=2", NOTHING),
    "next_task.pool": ("next_task.pool=7", NOTHING),
    "next_task.most": ("next_task.most=7", NOTHING),
    "next_task.samples": ("next_task.samples=7", NOTHING),
    "areas.subsets": ("areas.subsets=3", NOTHING),
    "areas.demonstrations": ("areas.demonstrations=[2]", NOTHING),
    "areas.log_odds": ("areas.log_odds=-2.0", NOTHING),
    "areas.adjacency": ("areas.adjacency=0.25", NOTHING),
    "soft.sets": ("soft.sets=7", NOTHING),
    "soft.demonstrations": ("soft.demonstrations=[2]", NOTHING),
    "soft.weights": ("soft.weights=[1.0]", NOTHING),
    "transfer.strengths": ("transfer.strengths=[2.0]", NOTHING),
    "transfer.trials": ("transfer.trials=7", NOTHING),
    "transfer.states": ("transfer.states=7", NOTHING),
    "dynamics.tasks": ("dynamics.tasks=7", NOTHING),
    "models.trials": ("models.trials=7", NOTHING),
    "models.seeded": ("models.seeded=true", NOTHING),
    "models.steps": ("models.steps=[0.5]", NOTHING),
    "models.tasks": ("models.tasks=7", NOTHING),
    "sampled.use": ("model=sampled", FORECASTS),
    "sampled.samples": ("sampled.samples=100", NOTHING),  # where nothing is sampled, as below
    "sampled.settle": ("sampled.settle=3", NOTHING),
    "sampled.most": ("sampled.most=8000", NOTHING),
    "sampled.restarts": ("sampled.restarts=3", NOTHING),
    "sampled.substeps": ("sampled.substeps=2", NOTHING),
    "sampled.tolerance": ("sampled.tolerance=0.1", NOTHING),
    "sampled.limited": ("sampled.limited=false", NOTHING),
    "resolution.counts": ("resolution.counts=[100]", NOTHING),
    "resolution.varying": ("resolution.varying=[100]", NOTHING),
    "resolution.most": ("resolution.most=7", NOTHING),
    "resolution.kinds": ("resolution.kinds=[averaged]", NOTHING),
    "resolution.tasks": ("resolution.tasks=7", NOTHING),
    "resolution.paths": ("resolution.paths=7", NOTHING),
    "resolution.finest": ("resolution.finest=7", NOTHING),
    "rollouts": ("rollouts=3", NOTHING),
    "misfit": ("misfit=99", NOTHING),
    "seed": ("seed=1", REAL),
}


def settings_of(*words: str) -> Settings:
    return read_config(composed(*BASE, *words))[0]


def keys(settings: Settings) -> dict[str, bytes]:
    """What the key of each stage is made from."""
    safe_set = canonical_json(stages.safe_set_inputs(settings))
    return {
        "safe_set": safe_set,
        "demonstrations": canonical_json(trials.demonstration_inputs(settings, safe_set.hex())),
        "mdp": canonical_json(stages.model_inputs(settings, settings.candidates)),
        "mdp_truth": canonical_json(stages.model_inputs(settings, settings.constraint)),
        "forecasts": canonical_json(plain(forecasts.forecast_inputs(settings))),
    }


def test_every_field_has_its_line() -> None:
    assert set(CHANGES) == set(flatten(plain(settings_of())))


@pytest.mark.parametrize("field", CHANGES)
def test_a_change_makes_anew_what_depends_on_it(field: str) -> None:
    words, stages_made_anew = CHANGES[field]
    if field == "system.target":  # two systems with the same arguments
        one = settings_of("system=double_integrator", "truth=wall", "hypotheses.shape=[10,null]")
        before = keys(one)
        tree = plain(one) | {"system": {**plain(one)["system"], "target": "mlci.systems.Another"}}
        assert canonical_json(tree["system"]) != canonical_json(plain(one)["system"])
        assert all(canonical_json(plain(one.system)) in before[stage] for stage in ALL)
        return
    # Words with spaces are in brackets; others are several overrides.
    several = [words] if "{" in words or "[" in words else words.split()
    base, changed = settings_of(), settings_of(*several)
    flat, other = (flatten(plain(each)) for each in (base, changed))
    of_field, of_other = (
        {k: v for k, v in tree.items() if k.startswith(field)} for tree in (flat, other)
    )
    assert of_field != of_other
    before, after = keys(base), keys(changed)
    assert {stage for stage in ALL if before[stage] != after[stage]} == stages_made_anew


def test_horizon_counts_for_a_safe_set_from_constant_controls() -> None:
    one, other = (settings_of("safety.method=escapes", f"horizon={h}") for h in (5.0, 4.0))
    assert keys(one)["safe_set"] != keys(other)["safe_set"]


def test_nothing_forbidden_still_depends_on_the_system() -> None:
    """Where there is no safe set, whose key would tell."""
    one, other = (settings_of("truth=none", f"system.length={length}") for length in (1.0, 2.0))
    inputs = [trials.demonstration_inputs(each, None) for each in (one, other)]
    assert canonical_json(inputs[0]) != canonical_json(inputs[1])
