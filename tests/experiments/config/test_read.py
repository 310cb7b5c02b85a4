"""Configs compose and validate; wrong ones are refused with a clear message, and write nothing."""

import dataclasses
import functools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from omegaconf import OmegaConf
from refusals import refusal
from tiny_point import composed, planned

from experiments.config.paths import CONF
from experiments.config.read import ConfigError, plain_tree, read_config
from experiments.config.settings import (
    BallSettings,
    ControlHypothesesSettings,
    ControlRange,
    HalfSpaceSettings,
    PredicateSettings,
    Region,
    ShapeSettings,
)


def options(group: str) -> list[str]:
    return sorted(path.stem for path in (CONF / group).glob("*.yaml"))


def identity(*overrides: str) -> str:
    return planned(read_config(composed(*overrides))[0], Path()).identity


@functools.cache
def suits(*words: str) -> bool:
    """Whether a truth can be inferred with a system: that it stays in bounds and can be ranked."""
    try:
        read_config(composed(*words))
    except ConfigError as error:
        # Anything else that is wrong is for the test to show.
        if str(error).startswith("truth"):
            return False
        raise
    return True


@pytest.mark.parametrize("truth", options("truth"))
def test_every_truth_suits_a_system(truth: str) -> None:
    # First with the system that its file brings, if any.
    systems = [f"system={system}" for system in options("system")]
    assert any(suits(*words, f"truth={truth}") for words in [(), *((each,) for each in systems)])


@pytest.mark.parametrize("system", options("system"))
def test_every_system_suits_a_truth(system: str) -> None:
    # First with any one of the hypotheses, which all systems have.
    truths = sorted(options("truth"), key=lambda truth: truth != "cell")
    assert any(suits(f"system={system}", f"truth={truth}") for truth in truths)


@pytest.mark.parametrize("grid", [name for name in options("grid") if name.isdigit()])
def test_every_grid_has_the_cells_of_its_name(grid: str) -> None:
    # Some are for systems of more dimensions than the pendulum's two.
    systems = {
        "1728": ["system=unicycle", "truth=cell"],
        "2401": ["system=cart_pole", "truth=cell"],
        "2500": ["truth=pain"],
        "4096": ["system=planar_quadrotor", "truth=cell"],
    }
    system = systems.get(grid, [])
    settings, _ = read_config(composed(f"grid={grid}", *system))
    assert settings.cells.size == settings.columns["cells"] == int(grid)


def test_defaults_are_the_walk_of_the_paper() -> None:
    settings, _ = read_config(composed())
    box = settings.constraint.box(0)
    assert box.lower == pytest.approx([math.pi, 0])
    assert box.upper == pytest.approx([6 / 5 * math.pi, 1.2])
    assert (settings.cells.shape, settings.action_counts, settings.dt) == ((20, 20), (9,), 0.25)
    assert len(settings.candidates) == 100
    read = read_config(composed("truth=c2"))[0].constraint.box(0)
    assert read.lower[0] == pytest.approx(8 / 5 * math.pi)
    assert read.upper[0] == pytest.approx(9 / 5 * math.pi)


def test_spelling_does_not_change_identity() -> None:
    same = [
        identity("dt=1"),
        identity("dt=1.0", "study=other", "results=elsewhere", "workers=3"),
        identity("dt=1", "truth.boxes=[{lower:[3.141592653589793,0],upper:['6/5 pi',1.2]}]"),
        identity("dt=1", "truth.boxes=[{lower:[pi,-0.0],upper:['6/5 pi',1.2]}]"),
        identity("dt=1", "~system.gravity"),
        identity("dt=1", "grid=100", "grid.shape=[20,20]"),
    ]
    assert len(set(same)) == 1


ONE_MORE = {"counts": (9,), "grids": ((9, 9),)}
IN_PLACE_OF_NONE = {
    "system": {"length": 1.5},
    "iterations": 7,
    "integrator": "rk4",
    "varying": (9,),
}


def changed(value: Any, name: str = "") -> Iterator[Any]:
    """Copies of settings, each with one value changed; another value where it is none."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            for other in changed(getattr(value, field.name), field.name):
                yield dataclasses.replace(value, **{field.name: other})
    elif isinstance(value, Mapping):
        yield {**value, "another": 1.0}
    elif isinstance(value, bool):
        yield not value
    elif isinstance(value, str):
        yield {"equation": "escapes", "euler": "rk4", "rk4": "euler", "ellipsoids": "boxes"}.get(
            value, f"{value}2"
        )
    elif isinstance(value, tuple):
        yield value[:-1] if len(value) > 1 else value * 2 or ONE_MORE.get(name, (0.25,))
    elif value is None:
        yield IN_PLACE_OF_NONE.get(name, (0.25,))
    else:
        yield value + (0.125 if isinstance(value, float) else -1 if value > 1 else 1)


def test_every_setting_changes_identity() -> None:
    of_reality = [
        "reality.system={length: 1.2}", "reality.effort=[0,0.1,0.1]", "reality.iterations=3",
        "reality.integrator=rk4", "reality.control_noise=[0.1]", "reality.sensor_noise=[0.1,0.1]",
    ]  # fmt: skip
    words = ["safety.margin=0.1", "truth=cell", "truth.cell=5", "action_range=[[-3,3]]"]
    settings, _ = read_config(composed(*words, *of_reality))
    boxes = (Region((0.0, None), (1.0, None)),)
    kinds = {
        "boxes": boxes,
        "balls": (BallSettings((0.5, None), (1.0, None)),),
        "half_spaces": (HalfSpaceSettings((0.0, 1.0), 5.0),),
        "shapes": (ShapeSettings("own.ring", {"width": 1.0}),),
    }
    limits = (ControlRange((0.5,), (None,)),)
    predicates = (PredicateSettings("own.push", {"above": 1.0}),)
    controls = ControlHypothesesSettings(limits, predicates, (0.5,), 0.02, 0.1)
    truth = dataclasses.replace(settings.truth, **kinds, controls=limits)
    hypotheses = dataclasses.replace(settings.hypotheses, **kinds, controls=controls)
    settings = dataclasses.replace(settings, truth=truth, hypotheses=hypotheses)
    others = list(changed(settings))
    assert len(others) > 30
    assert (
        len({planned(other, Path()).identity for other in [settings, *others]}) == len(others) + 1
    )


SETTINGS = "hydra.sweeper.settings="
COMMANDS = [
    ("dtt=0.2", "dtt: unknown key; did you mean dt?"),
    ("demonstrations.pars=3", "demonstrations.pars: unknown key; did you mean pairs?"),
    ("system.gravty=2", "system.gravty: unknown key; did you mean gravity?"),
    (
        "grid=300",
        "grid: there is no 300; there are 100, 400, 576, 900, 1600, 1728, 2401, 2500, 4096, "
        "adaptive",
    ),
    (
        "truth=c9",
        "truth: there is no c9; there are c1, c2, cell, knee, link, none, pain, wall, drawn, ",
    ),
    ("grdi=100", "grdi: unknown key; did you mean grid?"),
    ("dt=[1", "dt=[1: cannot be read as key=value"),
    ("dt", "dt: cannot be read as key=value"),
    ("dt=fast", "dt: 'fast' is not a finite number"),
    ("truth.name=${oc.env:HOME}", "truth.name: ${oc.env:HOME} would be kept in records, where"),
    ("dt=${nothing}", "dt: Interpolation key 'nothing' not found"),
    ("dt=0.2,0.25", "dt: several values need -m, for a sweep, or dt=[0.2,0.25], for a list"),
    (
        "grid.shape=[5,6,7]",
        "grid.shape: [5, 6, 7] must have 2 entries, one each for angle",
    ),
    ("truth.cell=37", "truth.cell: 37 and 1 regions are given; keep one of them"),
    ("sweep.time_limit=5", "sweep.time_limit: only a sweep heeds it; add -m, or leave it out"),
    ("sweep.retries=1", "sweep.retries: only a sweep heeds it"),
    ("hydra.run.dirr=x", "hydra.run.dirr: unknown key; did you mean dir?"),
]
# Values, which are refused once a config is composed.
VALUES = [
    ("+dtt=0.2", "dtt: unknown key; did you mean dt?"),
    ("++demonstrations.pars=3", "demonstrations.pars: unknown key; did you mean pairs?"),
    ("+system.gravty=2", "system.gravty: Pendulum has no such argument; did you mean gravity?"),
    ("system._target_=os.system", "'os.system' is not a subclass of mlci.systems.System"),
    ("system._target_=mlci.systems.System", "is not a subclass"),
    ("system._target_=nowhere.Pendulum", "system._target_: 'nowhere.Pendulum' cannot be imported"),
    ("system.speed_limit=-1", "system: Pendulum.speed_limit must be positive, not -1.0"),
    ("system.speed_limit=fast", "system.speed_limit: 'fast' is not a finite number"),
    ("~system._target_", "system._target_: missing"),
    ("~system", "system: missing"),
    ("dt=nan", "dt: nan is not a finite number"),
    ("dt=true", "dt: True is not a finite number"),
    ("dt=", "dt: '' is not a finite number"),
    ("dt=???", "dt: missing; give it a value"),
    ("~dt", "dt: missing; give it a value"),
    ("dt=0", "dt: 0.0 must be above 0"),
    ("action_range=[[2,1]]", "action_range: [[2.0, 1.0]] must be 1 pairs, each of a lower and"),
    ("action_range=[[1,1]]", "action_range: [[1.0, 1.0]] must be 1 pairs, each of a lower and"),
    ("action_range=[[-1,1],[-1,1]]", "action_range: [[-1.0, 1.0], [-1.0, 1.0]] must be 1 pairs"),
    ("inference.rule_breaking=1", "inference.rule_breaking: 1.0 must be below 1"),
    ("inference.rule_breaking=guess", "inference.rule_breaking: 'guess' is not a finite number"),
    ("dt=0.3", "dt: 0.3 does not cut the horizon 5.0 into whole steps; try 0.25 or 0.3125"),
    ("dt=7", "dt: 7.0 does not cut the horizon 5.0 into whole steps; try 5"),
    ("dt=1e-300", "dt: 1e-300 cuts the horizon 5.0 into more than 100000 steps"),
    ("demonstrations.dt=0.03", "demonstrations.dt: 0.03 does not cut the horizon"),
    ("seed=-1", "seed: -1 must be at least 0"),
    ("seed=1.5", "seed: 1.5 is not a whole number"),
    ("temperature=0", "temperature: 0.0 must be above 0"),
    ("actions=0", "actions: 0 must be at least 1"),
    ("actions=[3,4]", "actions: [3, 4] must be one number, or a list of 1"),
    ("grid.shape=[100000,100000]", "1 samples and these hypotheses takes about 7.7e+03 GB"),
    ("demonstrations.pairs=1000000", "demonstrations.pairs: 1000000 trials, of 3 first guesses"),
    ("dynamics.tasks=1000000", "dynamics.tasks: 1000000 trials, of 3 first guesses"),
    ("sampled.restarts=1000000", "sampled.restarts: 1000000 must be at most 1000"),
    ("soft.weights=[1e300]", "soft.weights[0]: 1e+300 must be at most 1000000"),
    ("rollouts=10000000", "rollouts: 10000000 must be at most 1000000"),
    ("transition.samples=0", "transition.samples: 0 must be at least 1"),
    ("inference.prior=1", "inference.prior: 1.0 must be below 1"),
    ("demonstrations.keep=101", "demonstrations.keep: 101 is more than the 100 of"),
    ("grid.shape=[]", "grid.shape: [] is empty"),
    ("grid.shape=[0,5]", "grid.shape[0]: 0 must be at least 1"),
    ("grid.shape=9", "grid.shape: 9 is not a list"),
    ("system=double_integrator", "truth.boxes[0]: position from 3.14159 to 3.76991 leaves"),
    ("truth.boxes=[]", "truth.boxes: [] is empty; give at least one box, with lower and upper, or"),
    ("truth.name=none", "truth.name: none means that nothing is forbidden; take another name"),
    ("calibration.sets=-1", "calibration.sets: -1 must be at least 0"),
    (
        "calibration.sets=2",
        "calibration.sets: 2, but the prior knows no such truth; take",
    ),
    ("calibration.demonstrations=[]", "calibration.demonstrations: [] is empty"),
    ("calibration.demonstrations=[0]", "calibration.demonstrations[0]: 0 must be at least 1"),
    ("truth.cell=-1", "truth.cell: -1 must be at least 0"),
    ("grid.offset=[0.5]", "grid.offset: [0.5] must have 2 entries, one each for angle"),
    ("grid.offset=[1,0]", "grid.offset[0]: 1.0 must be below 1"),
    ("grid.offset=[0,0.5]", "grid.offset: [0.0, 0.5] shifts angular_velocity, which has ends"),
    ("tasks.goal=[0.1]", "tasks.goal: [0.1] must have 2 entries, one each for angle"),
    ("tasks.goal=[0.1,-1]", "tasks.goal[1]: -1.0 must be at least 0"),
    ("tasks.lower=[null,3.0]", "tasks: angular_velocity goes from 3.0 to 2.0"),
    ("tasks.crossing=1", "tasks.crossing: 1 is not true or false"),
    ("safety.method=magic", "safety.method: 'magic' must be 'equation', 'escapes' or 'barrier'"),
    ("truth.boxes=[{lower:[0],upper:[1]}]", "truth.boxes[0].lower: [0.0] must have 2 entries"),
    ("truth.boxes=[{lower:[0,1],upper:[1,0]}]", "angular_velocity goes from 1.0 to 0.0"),
    ("truth.boxes=[{lower:[0,null],upper:[1,0]}]", "angular_velocity has one side only"),
    ("truth.boxes=[{lower:[0,1],upper:[7,2]}]", "is over a whole turn; use null twice"),
    ("truth.boxes=[{lower:[0,1],top:[1,2]}]", "truth.boxes[0].top: unknown key"),
    ("truth.boxes=[{lower:[3,0],upper:[3.1,1]}]", "truth: c1 covers no hypothesis entirely"),
    ("hypotheses.shape=null", "hypotheses: no shape and no boxes"),
    ("study=../x", "study: '../x' cannot name a folder"),
    ("study=" + "a" * 256, "study: aaaaaaaaaaaaaaaaaaaa... has 256 letters, which a folder's name"),
    ("workers=0", "workers: 0 must be at least 1"),
    ("dt=pi/0", "dt: 'pi/0' is not a finite number, or a multiple of pi such as \"6/5 pi\""),
    ("seed=" + "9" * 4000, "seed: 9999999999"),
    ("seed=4294967296", "seed: 4294967296 must be below 4294967296"),
    (
        "safety.shape=[1,2]",
        "safety.shape: [1, 2] has no cell centre inside the truth's box 0 along "
        "angle and angular_velocity; use more cells",
    ),
    ("safety.shape=[100000,100000]", "safety.shape: [100000, 100000] makes too many values"),
    ("safety.shape=[5]", "safety.shape: [5] must have 2 entries, one each for angle"),
    (
        "safety.margin=1e308",
        "safety.margin: 1e+308 is more than the state space is wide, 12; lower",
    ),
    ("safety.width=12.5", "safety.width: 12.5 is more than the state space is wide, 12; lower it"),
    ("truth.boxes=[{lower:[null,null],upper:[null,null]}]", "truth.boxes[0]: forbids every state"),
    ("truth.boxes=[{lower:[0,-6],upper:['2 pi',6]}]", "truth.boxes: c1 forbids every state; make"),
    (
        "truth.boxes=[{lower:[0,-6],upper:[4,6]},{lower:[4,null],upper:['2 pi',null]}]",
        "truth.boxes: c1 forbids every state; make its boxes smaller",
    ),
    ("truth.boxes=3", "truth.boxes: 3 is not a list"),
    ("truth.boxes=[3]", "truth.boxes[0]: 3 is not a region; write its ends"),
    ("truth.boxes=[{lower:[0,1]}]", "truth.boxes[0].upper: missing; give it a value"),
    ("truth.balls=[3]", "truth.balls[0]: 3 is not a ball; write its centre and semi-axes"),
    ("truth.balls=[{center:[0],radii:[1]}]", "truth.balls[0]: a ball needs a centre of 2"),
    ("truth.balls=[{center:[0,1],radii:[1,0]}]", "truth.balls[0].radii[1]: 0.0 must be above 0"),
    ("truth.balls=[{center:[0,1],radii:[null,null]}]", "truth.balls[0]: a ball needs positive"),
    ("truth.balls=[{center:[0,1],radius:1}]", "truth.balls[0].radius: unknown key"),
    ("truth.balls=[{center:[0,99],radii:[1,1]}]", "truth.balls[0] holds nothing of the bounds"),
    ("truth.half_spaces=[1]", "truth.half_spaces[0]: 1 is not a half-space; write {normal"),
    ("truth.half_spaces=[{normal:[1,0],offset:1}]", "truth.half_spaces[0]: angle wraps"),
    ("truth.half_spaces=[{normal:[0,1],offset:7}]", "truth.half_spaces[0] holds nothing of"),
    ("hypotheses.half_spaces=[{normal:[0],offset:1}]", "hypotheses.half_spaces[0]: a half-space"),
    ("truth.shapes=[{}]", "truth.shapes[0]._target_: missing; name a function that returns a"),
    ("truth.shapes=[{_target_:no.such}]", "truth.shapes[0]._target_: 'no.such' cannot be imported"),
    ("truth.shapes=[{_target_:math.pi}]", "truth.shapes[0]._target_: 'math.pi' is no function"),
    ("truth.shapes=[{_target_:math.tau}]", "'math.tau' is no function"),
    ("truth.shapes=[{_target_:fractions.Fraction}]", "fractions.Fraction must return a region"),
    (
        "truth.shapes=[{_target_:mlci.shapes.balls.Ball}]",
        "truth.shapes[0].center: missing; give it",
    ),
    (
        "truth.shapes=[{_target_:mlci.shapes.balls.Ball,center:[0],radii:[0]}]",
        "truth.shapes[0]: mlci.shapes.balls.Ball fails: ValueError: a ball needs positive radii",
    ),
    (
        "truth.shapes=[{_target_:mlci.shapes.balls.Ball,center:[0],radii:1}]",
        "truth.shapes[0]: a ball needs a centre of 2 dimensions",
    ),
    ("truth.name=3", "truth.name: 3 is not a word"),
    ("actions=[3.5]", "actions[0]: 3.5 is not a whole number"),
    ("actions=[]", "actions: [] is empty; give at least one"),
    ("sweep.only=[done]", "sweep.only[0]: 'done' must be 'missing', 'failed' or 'stale'"),
    ("+sweep.foo=1", "sweep.foo: unknown key; known are dry_run, fail_fast, force, limit, "),
]


@pytest.mark.parametrize(("word", "message"), COMMANDS)
def test_wrong_word_is_refused(
    word: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refusal([word, "results=results"], monkeypatch, capsys)
    assert message in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("word", "message"), VALUES)
def test_wrong_value_is_refused(word: str, message: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        read_config(composed(word))
    assert message in str(refusal.value)
    assert len(str(refusal.value).splitlines()) < 10


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"boxes: [1\n", "/truth/mine.yaml, line 2: not valid YAML"),
        (b"name: a\nname: b\n", "/truth/mine.yaml, line 2: not valid YAML"),
        (b"name: \xff\n", "/truth/mine.yaml: byte 6 is not UTF-8"),
        (b"- a\n", "/truth/mine.yaml: holds a list, not keys with values"),
        (b"", "truth.name: missing"),
        (b"defaults: 3\n", "Invalid defaults list in 'truth/mine'"),
    ],
)
def test_broken_file_is_refused(
    content: bytes,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "mine.yaml").write_bytes(content)
    said = refusal(["--config-dir", str(tmp_path), "truth=mine"], monkeypatch, capsys)
    assert message in said


def test_hypothesis_that_is_the_truth_must_exist(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refusal(["truth=cell", "truth.cell=100"], monkeypatch, capsys)
    assert "truth.cell: 100 is not the number of a hypothesis; there are 100, from 0 to 99" in said


def test_a_hypothesis_or_nothing_can_be_the_truth() -> None:
    cell, _ = read_config(composed("truth=cell", "truth.cell=37"))
    assert cell.columns["truth"] == "cell_37"
    assert np.flatnonzero(cell.candidates.inside(cell.constraint)).tolist() == [37]
    assert np.flatnonzero(cell.constraint.inside(cell.candidates)).tolist() == [0]
    nothing, _ = read_config(composed("truth=none"))
    assert nothing.columns["truth"] == "none"
    assert len(nothing.constraint) == 0
    one, other = identity("truth=cell", "truth.cell=1"), identity("truth=cell", "truth.cell=2")
    assert one != other


def test_a_box_of_an_angle_may_go_across_the_seam() -> None:
    boxes = "[{lower: ['9/5 pi', 0], upper: ['11/5 pi', 1.2]}]"
    settings, _ = read_config(composed(f"truth.boxes={boxes}"))
    assert np.flatnonzero(settings.candidates.inside(settings.constraint)).tolist() == [5, 95]


def test_tasks_cannot_cross_what_is_not_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refusal(["truth=none", "tasks.crossing=true"], monkeypatch, capsys)
    assert "tasks.crossing: true, but no truth is there to cross; set it to false" in said


def test_all_wrong_points_of_a_sweep_are_reported_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["-m", "dt=0.25,0.3", "actions=0,5", f"results={tmp_path}"]
    said = refusal(arguments, monkeypatch, capsys)
    assert "actions: 0 must be at least 1 [2 of 4 points, such as dt=0.25 actions=0]" in said
    assert "dt: 0.3 does not cut" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["-m", "grid=100,300"],
            "grid: there is no 300; there are 100, 400, 576, 900, 1600, 1728, 2401, 2500, 4096, "
            "adaptive [1",
        ),
        (["-m", "experiment=paper,other"], "experiment=paper,other: a sweep over experiments"),
        (["-m", "study=a,b"], "study=a,b: this changes no result"),
        (["-m", "hydra/sweeper=basic"], "hydra/sweeper=basic: sweeps are planned by mlci's own"),
        (
            ["-m", "results=out/s${seed}", "seed=3,4"],
            "results: out/s3 for one point and out/s4 for another, but a sweep has one; give",
        ),
        (["-m", "study=s${seed}", "seed=3,4"], "study: s3 for one point and s4 for another, but"),
        (["-m", "workers=${seed}", "seed=3,4"], "workers: 3 for one point and 4 for another, but"),
        (["-m", "sweep.limit=${seed}", "seed=3,4"], "sweep: SweepSettings("),
        (["-m", "dt=interval(0,1)"], "dt=interval(0,1): cannot be swept; list its values"),
        (["experiment=paper", "hydra.mode=RUN"], "experiment: this one describes a sweep; add -m"),
        ([f"{SETTINGS}[[]]"], "experiment: this one describes a sweep; add -m"),
        (["-m", f"{SETTINGS}3"], "sweeper.settings: 3 is no list of lists of overrides"),
        (["-m", f"{SETTINGS}[[],seed]"], "sweeper.settings[1]: 'seed' is no list of overrides, s"),
        (["-m", f"{SETTINGS}[[3]]"], "sweeper.settings[0]: [3] is no list of overrides, such as"),
        (["-m", f"{SETTINGS}[[],[seed]]"], "sweeper.settings[1]: seed cannot be read as key=value"),
        (
            ["-m", f"{SETTINGS}[['dt=interval(0,1)']]"],
            "dt=interval(0,1): cannot be swept; list its",
        ),
        (
            ["-m", f"{SETTINGS}[['study=x']]"],
            "settings[0]: study=x: this changes no result, so give",
        ),
        (
            ["-m", f"{SETTINGS}[['seed=1','seed=2']]"],
            "settings[0]: seed=2 is the second value of seed",
        ),
        (
            ["-m", "experiment=paper", f"{SETTINGS}[[],['dt=0.5']]"],
            "hydra.sweeper.settings[1]: dt=0.5: params sweep dt too; leave it to one of them",
        ),
        (
            ["-m", "dt=0.5,1.0", f"{SETTINGS}[[],['sed=1']]"],
            "sed: unknown key; did you mean seed? [2 of 4 points, such as dt=0.5 sed=1]",
        ),
    ],
)
def test_sweep_that_cannot_be_is_refused(
    arguments: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert message in refusal(arguments, monkeypatch, capsys)


@pytest.mark.parametrize("name", ["file", "file/inside", "."])
def test_results_that_cannot_be_written_are_refused_before_any_work(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for taken in ("file", "points"):
        (tmp_path / taken).write_text("")
    message = f"results: nothing can be written into {tmp_path / name / 'points'} ("
    for words in ([], ["-m", "dt=0.5,1.0"]):
        words = [*words, "scale=smoke", f"results={tmp_path / name}"]
        assert message in refusal(words, monkeypatch, capsys)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "points"]


HIDDEN = [
    ["results=${oc.env:HOME}", "truth.name=${results}"],
    ["hydra.job.name=${oc.env:HOME}", "truth.name=${hydra:job.name}"],
    ["truth.name=${oc.env :HOME}"],
    ["truth.name='a_${oc.decode:${oc.env:HOME}}'"],
    ["-m", "truth.name=${oc.env:HOME}", "seed=0,1"],
    ["-m", "+hydra.sweeper.params={truth.name:'${oc.env:HOME}'}"],
]


@pytest.mark.parametrize("words", HIDDEN, ids=" ".join)
def test_a_variable_of_the_environment_is_refused_however_a_record_would_hold_it(
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "the_secret")
    said = refusal(words, monkeypatch, capsys)
    assert "truth.name: " in said
    assert "would be kept in records" in said
    assert "the_secret" not in said
    assert not list(tmp_path.iterdir())


def test_a_path_may_hold_a_variable_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/me")
    tree = {"results": "${oc.env:HOME}/out", "dt": 0.5}
    assert plain_tree(OmegaConf.create(tree)) == {"results": "/home/me/out", "dt": 0.5}
