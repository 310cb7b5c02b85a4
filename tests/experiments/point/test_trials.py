"""Demonstrators who ignore the constraint, and recordings that differ from what was done."""

from pathlib import Path

import numpy as np
import pytest
from tiny_point import TINY, composed

from experiments.config.read import ConfigError, read_config
from experiments.config.settings import Settings
from experiments.point import trials
from experiments.point.run import run_point
from experiments.tracking.store import Store
from mlci.demonstrator import enters
from mlci.simulate import EULER, RK4, rollout
from mlci.systems import Pendulum

WORDS = ("safety.shape=[41,41]", "demonstrations.pairs=40", "demonstrations.keep=40")
WORDS += ("demonstrations.dt=0.05", "demonstrations.restarts=1")


def settings_of(*words: str) -> Settings:
    return read_config(composed(*words))[0]


def test_who_breaks_the_rule_is_kept_although_he_enters_the_truth(tmp_path: Path) -> None:
    store = Store(tmp_path)
    obedient, some = (
        trials.demonstrations(settings_of(*WORDS, f"demonstrations.rule_breaking={share}"), store)
        for share in (0.0, 0.4)
    )
    breaking = some.rule_breaking
    assert not obedient.rule_breaking.any()
    assert 8 <= breaking.sum() <= 24  # 16 expected, with a standard deviation of 3.1
    # Tasks are the same, and so is all that the others do.
    np.testing.assert_array_equal(some.starts, obedient.starts)
    np.testing.assert_array_equal(some.states[~breaking], obedient.states[~breaking])
    entered = enters(
        Pendulum(), settings_of(*WORDS).constraint, some.states, some.controls, dt=0.05
    )
    assert (entered & breaking).any()
    kept = some.outcome == "kept"
    assert kept[entered & breaking].all()
    assert not kept[entered & ~breaking].any()


def test_breakers_of_a_smaller_share_break_at_a_larger_one() -> None:
    few, many = (
        trials.rule_breakers(settings_of(f"demonstrations.rule_breaking={share}"))
        for share in (0.1, 0.3)
    )
    assert 0 < few.sum() < many.sum()
    assert many[few].all()


def test_tables_tell_who_breaks_the_rule(tmp_path: Path) -> None:
    settings = settings_of(*TINY, "demonstrations.rule_breaking=0.5")
    tables = run_point(settings, Store(tmp_path), lambda line: None)
    breaking = trials.rule_breakers(settings)
    assert 0 < breaking.sum() < len(breaking)
    assert tables["attempts"]["rule_breaking"].tolist() == breaking.tolist()
    assert (
        tables["trials"]["rule_breaking"].tolist() == breaking[tables["trials"]["trial"]].tolist()
    )


def test_demonstrators_move_the_real_system(tmp_path: Path) -> None:
    store = Store(tmp_path)
    heavy = "reality.system={mass: 1.4, drag: 0.2}"
    settings = settings_of(*WORDS, heavy, "reality.integrator=rk4")
    real = trials.demonstrations(settings, store)
    system = Pendulum(mass=1.4, drag=0.2)
    for mover, step, fits in (
        (system, RK4.step, True),
        (system, EULER.step, False),
        (Pendulum(), RK4.step, False),
    ):
        paths = rollout(mover, real.starts, real.controls, 0.05, step=step)
        assert (np.max(np.abs(paths - real.states)) < 1e-9) == fits
    assert settings.model.mass == 1.0  # what the tabular model moves


def test_real_demonstrators_may_be_hasty_or_spare_their_speed(tmp_path: Path) -> None:
    store = Store(tmp_path)
    best, hasty, careful, shaky = (
        trials.demonstrations(settings_of(*WORDS, *words), store)
        for words in (
            [],
            ["reality.iterations=2"],
            ["reality.effort=[0.0,5.0,0.0]"],
            ["reality.control_noise=[0.1]"],
        )
    )
    assert np.mean(best.cost) < np.mean(hasty.cost)
    kept = (best.outcome == "kept") & (careful.outcome == "kept")
    speeds = [np.mean(np.square(each.states[kept, :, 1])) for each in (best, careful)]
    assert speeds[1] < 0.9 * speeds[0]
    jerks = [np.std(np.diff(each.controls, axis=1)) for each in (best, shaky)]
    # White noise of 0.1 / sqrt(0.05) = 0.45 adds about sqrt(2) times that to what smooth ones have.
    assert jerks[1] > jerks[0] + 0.2


def test_recorded_states_are_noisy_and_tasks_read_off_them(tmp_path: Path) -> None:
    store = Store(tmp_path)
    exact, noisy = (
        trials.demonstrations(settings_of(*WORDS, *words), store)
        for words in ([], ["reality.sensor_noise=[0.02,0.05]"])
    )
    kept = exact.outcome == "kept"  # what leaves the space is cut off where it is recorded
    noise = noisy.states[kept] - exact.states[kept]
    assert len(noise) > 30
    # Over 3000 samples: four standard errors of a standard deviation are below 5.2 %.
    np.testing.assert_allclose(np.std(noise, axis=(0, 1)), [0.02, 0.05], rtol=0.052)
    np.testing.assert_array_equal(noisy.outcome, exact.outcome)
    np.testing.assert_array_equal(noisy.starts, noisy.states[:, 0])
    np.testing.assert_array_equal(noisy.goal_upper, noisy.states[:, -1])
    assert len(noisy.demonstration(0, 5.0, 0.05).states) == 101  # a valid demonstration
    wild = trials.demonstrations(settings_of(*WORDS, "reality.sensor_noise=[0.0,9.0]"), store)
    assert np.max(np.abs(wild.states[..., 1])) == 6.0


def test_prescribed_goal_regions_stay(tmp_path: Path) -> None:
    words = [*WORDS, "tasks.goal=[0.1,null]", "reality.sensor_noise=[0.02,0.05]"]
    goals = trials.demonstrations(settings_of(*words), Store(tmp_path))
    np.testing.assert_allclose(goals.goal_upper[:, 0] - goals.goal_lower[:, 0], 0.2)
    assert np.all(goals.goal_upper[:, 1] == np.inf)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        (
            "reality.system={lenght: 1.2}",
            "reality.system.lenght: Pendulum has no such argument; did",
        ),
        ("reality.system={length: -1}", "reality.system: Pendulum.length must be positive"),
        ("reality.system={length: far}", "reality.system.length: 'far' is not a finite number"),
        ("reality.system={_target_: a.b}", "reality.system._target_: Pendulum has no such"),
        ("reality.system=3", "reality.system: 3 is not a group of values"),
        ("reality.system={speed_limit: 8}", "changes the range of states or controls"),
        ("reality.effort=[0,1]", "must have 3 entries, one a state and control"),
        ("reality.effort=[1,1,0]", "reality.effort: the square of angle, which goes round, jumps"),
        (
            "reality.sensor_noise=[1]",
            "reality.sensor_noise: [1.0] must have 2 entries, one a state",
        ),
        ("reality.control_noise=[1,1]", "[1.0, 1.0] must have 1 entries, one a control"),
        ("++reality.iteration=2", "reality.iteration: unknown key; did you mean iterations?"),
    ],
)
def test_reality_that_cannot_be_is_refused(word: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        settings_of(word)
    assert message in str(error.value)


def test_rules_need_a_truth() -> None:
    with pytest.raises(ConfigError, match="no truth is there to break; set it to 0"):
        settings_of("truth=none", "demonstrations.rule_breaking=0.1")


@pytest.mark.parametrize(
    "word",
    [
        "next_task.repetitions=1",
        "areas.subsets=1",
        "soft.weights=[1.0]",
        "transfer.strengths=[2.0]",
    ],
)
def test_questions_of_a_truth_need_one(word: str) -> None:
    with pytest.raises(ConfigError, match="no truth is there to ask about; set it to"):
        settings_of("truth=none", word)


def test_arguments_that_change_nothing_are_no_other_reality() -> None:
    plain, same = settings_of(), settings_of("reality.system={length: 1, drag: 0}")
    assert same == plain


def test_tasks_are_drawn_anew_until_enough_cross_the_truth(tmp_path: Path) -> None:
    words = [*(word for word in TINY if ".keep" not in word), "demonstrations.keep=6"]
    settings, of_any_task = settings_of(*words, "tasks.crossing=true"), settings_of(*words)
    starts, first = (
        trials.demonstrations(each, Store(tmp_path)).starts for each in (settings, of_any_task)
    )
    assert len(np.unique(starts, axis=0)) == len(starts) == 6
    assert not np.all(np.isin(starts, first))
