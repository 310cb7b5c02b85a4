"""Doubts about recordings: each kind where it is right, and none about good recordings."""

import json

import numpy as np
import pytest

from mlci.crossings import ANY, Crossing
from mlci.demonstrations import Demonstration
from mlci.recordings.plausibility import Plausibility, plausibility, summary
from mlci.regions import Regions
from mlci.simulate import EULER, RK4, rollout
from mlci.systems import Pendulum

SYSTEM = Pendulum()
SPACE = SYSTEM.space
CELLS = Regions.from_grid(SPACE, (10, 10))
TIME = np.arange(501) / 100
CONTROLS = 1.5 * np.sin(2 * TIME[:-1, None])
SMOOTH = rollout(SYSTEM, np.array([1.0, 0.5]), CONTROLS, 0.01)


def check(
    path: np.ndarray,
    time: np.ndarray = TIME,
    regions: Regions = CELLS,
    crossing: Crossing = ANY,
    name: str = "walk",
) -> Plausibility:
    path = SPACE.unwrap(path)
    return plausibility(SYSTEM, regions, Demonstration.from_path(path, time, name=name), crossing)


def words(found: Plausibility) -> list[str]:
    return [text for _, text in found.doubts]


@pytest.mark.parametrize("integrator", [EULER, RK4])
def test_there_is_no_doubt_about_a_motion_of_the_system(integrator) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        start = rng.uniform([0, -1.5], [2 * np.pi, 1.5])
        controls = np.repeat(rng.uniform(-2, 2, (10, 1)), 50, axis=0)
        path = rollout(SYSTEM, start, controls, 0.01, step=integrator.step)
        assert words(check(path)) == []
        few = np.append(np.arange(0, 500, 7), 500)
        assert words(check(path[few], TIME[few])) == []


def test_an_angle_in_degrees_is_named_with_its_factor() -> None:
    (text,) = words(check(SMOOTH * [180 / np.pi, 1.0]))
    assert text.startswith("angle moves 57.3 times faster than angular velocity says (residual: ")
    assert text.endswith("rad/s): is it in degrees? then units={angle: deg}")


def test_a_control_range_that_cannot_be_is_named() -> None:
    hard = rollout(SYSTEM, np.array([1.0, 0.5]), 3 * CONTROLS, 0.01)
    assert any(
        "angular velocity moves as no control in range" in text for text in words(check(hard))
    )


def test_coarse_samples_are_named() -> None:
    path = np.array([[0.3 + 2.7 * k, 2.7] for k in range(6)])
    turns, steps = words(check(path, np.arange(6.0)))
    assert "turns by up to 2.7 rad between samples (5 of 5 steps), nearly half a turn" in turns
    assert "5 of 5 steps are wider in angle than a region (up to 2.7 of 0.628 rad)" in steps
    path = np.array([[0.3 + 4.0 * k, 4.0] for k in range(6)])
    turns, _ = words(check(path, np.arange(6.0)))
    assert turns.startswith("angle turns by more than half a turn between samples, as the dynamics")


def test_a_bad_sample_is_named_with_what_it_alone_decides() -> None:
    path = SMOOTH.copy()
    path[250] = SMOOTH[250] + [2.5, -3.0]
    with_it, without = (CELLS.violated_by(each) for each in (path, SMOOTH))
    alone = [name for name, one in zip(CELLS.names, with_it & ~without, strict=True) if one]
    (text,) = words(check(path))
    assert text.startswith("at 2.5 s a sample jumps out and back by up to ")
    assert f"the path enters regions {', '.join(alone[:6])}" in text
    assert text.endswith("by crossing.time=0.02")
    (text,) = words(check(path, crossing=Crossing(time=0.02)))
    assert text.endswith("faster than the dynamics allow, which decides no region")


def test_a_region_that_noise_may_have_entered_is_named() -> None:
    noisy = SMOOTH + np.random.default_rng(0).normal(0, 0.01, SMOOTH.shape) * [1, 3]
    top = noisy[:, 1].max()
    regions = Regions(SPACE, [[0.0, top - 0.02], [0.0, 0.0]], [[6.0, top + 1], [6.0, top - 0.5]])
    (text,) = words(check(noisy, regions=regions))
    assert text.startswith("enters region 0 by less than twice its noise (angle 0.0")
    assert text.endswith("crossing.depth=0.02 would not count that")
    assert words(check(noisy, regions=regions, crossing=Crossing(depth=0.02))) == []


def test_many_recordings_are_summed_up() -> None:
    checks = [check(SMOOTH, name="good")]
    checks += [check(SMOOTH * [180 / np.pi, 1.0], name=f"deg{i}") for i in range(2)]
    assert summary(checks) == ["2 of 3 recordings do not move as the dynamics allow: deg0, deg1"]
    assert str(checks[1]).startswith("deg0: angle moves 57.3 times faster")


def test_the_numbers_are_fit_for_json() -> None:
    record = check(np.tile([1.0, 0.0], (501, 1))).record(SPACE)
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert record["factor"]["angle"] is None
    assert set(record) == {
        *("name", "doubts", "median_residual", "worst_residual", "factor", "noise")
    }
