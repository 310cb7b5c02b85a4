from dataclasses import replace

import numpy as np
import pytest
from linear_bridge import WIDE, Bridge, random_bridge
from scipy.special import ndtri

from mlci.demonstrations import Task
from mlci.regions import Regions
from mlci.sampled.distribution import SampledDistribution
from mlci.sampled.model import SampledModel
from mlci.sampled.passage import Passage
from mlci.sampled.rare_regions import RareViolations, rare_violations
from mlci.shapes.predicates import Predicate
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum


def hill(rng: np.random.Generator) -> Bridge:
    """A bridge that begins upwards and ends downwards, so that it is highest on the way."""
    start, end = rng.uniform([-1.0, 0.0], [1.0, 1.0]), rng.uniform([-1.0, -1.0], [1.0, 0.0])
    half, temperature = rng.choice([0.05, 0.2]), float(rng.choice([0.3, 1.0, 3.0]))
    goal = Box(end - half, end + half)
    return Bridge(Passage(WIDE, start, goal, 12, 0.25, temperature, substeps=4))


def sampled(bridge: Bridge, regions: Regions, samples: int = 1500) -> SampledDistribution:
    passage = bridge.passage
    model = SampledModel(WIDE, regions, passage.dt, passage.temperature, samples=samples)
    return model.distribution(Task(passage.start, passage.goal, passage.steps * passage.dt))


def above(heights: list[float]) -> Regions:
    """All positions above each height."""
    lower = np.array([[height, -np.inf] for height in heights])
    return Regions(WIDE.space, lower, np.array([[50.0, np.inf]] * len(heights)))


def heights_of(bridge: Bridge, chances: list[float]) -> tuple[list[float], Floats]:
    """Heights that paths rise above as rarely as that, or nearly, and how rarely."""
    passage, chosen = bridge.passage, list[float]()
    height = max(passage.start[0], passage.goal.upper[0]) + 0.02  # else the ends decide
    for chance in chances:
        while bridge.chance_of_rise(height, 100, np.random.default_rng(0)) > chance:
            height += 0.05
        chosen.append(height)
    told = [bridge.chance_of_rise(height, 8000, np.random.default_rng(1)) for height in chosen]
    return chosen, np.array(told)


def scores(worlds: int, seed: int) -> Floats:
    """Errors of Phi (N, 3), from a thousandth to a millionth, in standard errors."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(worlds):
        bridge = hill(rng)
        heights, exact = heights_of(bridge, [1e-3, 1e-4, 1e-6])
        rare = rare_violations(sampled(bridge, above(heights)), range(3), samples=3000)
        assert np.all(rare.upper >= rare.phi)
        found.append((rare.phi - exact) / np.hypot(rare.error, 0.02 * exact))
    return np.array(found)


def test_the_oracle_is_what_many_exact_paths_show():
    bridge = hill(np.random.default_rng(0))
    heights, exact = heights_of(bridge, [0.05, 0.02])
    paths = bridge.paths(6000, np.random.default_rng(2))
    share = np.mean(above(heights).violated_by(paths), axis=0)
    error = np.sqrt(exact / len(paths) + np.square(0.03 * exact))
    assert np.all(np.abs(share - exact) < 3 * error)


def test_rare_regions_of_linear_passages_have_the_exact_probability():
    apart = scores(worlds=1, seed=3)
    assert np.max(np.abs(apart)) < 3.5


@pytest.mark.long
def test_errors_of_rare_regions_are_as_large_as_said():
    apart = scores(worlds=40, seed=4)
    assert np.mean(np.abs(apart) < 1.96) > 0.88
    assert np.mean(np.abs(apart) < 3) > 0.97


def test_a_box_beside_the_way_and_what_is_not_rare():
    bridge = random_bridge(np.random.default_rng(1))
    start = bridge.passage.start
    middle = start + np.array([0.6, -2.5])
    regions = Regions(WIDE.space, [middle, start - 0.2], [middle + 0.5, start + 0.2])
    paths = bridge.paths(20_000, np.random.default_rng(2))
    share = np.mean(regions.violated_by(paths), axis=0)
    distribution = sampled(bridge, regions)
    rare = rare_violations(distribution, [0, 1])
    assert rare.error[1] > distribution.log_z_error  # what all paths cross is as uncertain as Z
    error = np.hypot(rare.error, np.sqrt(share * (1 - share) / len(paths)))
    assert share[1] == 1
    assert rare.upper[1] == 1
    assert 0 < share[0] < 0.02
    assert np.all(np.abs(rare.phi - share) < 3.2 * error)


def test_under_a_truth_only_paths_count_that_keep_out_of_it():
    bridge = hill(np.random.default_rng(1))
    heights, _ = heights_of(bridge, [0.05, 0.02])
    distribution = sampled(bridge, above(heights[::-1]))
    phi = distribution.under([True, False])
    rare = rare_violations(phi, [1])
    direct = phi.violation_probabilities()[1]
    assert abs(rare.phi[0] - direct) < 3.2 * np.hypot(rare.error[0], phi.avoidance_errors()[1])
    assert rare_violations(phi, [0]).phi[0] == 0  # whoever keeps out of it does not enter it


def test_where_no_path_comes_the_limit_is_that_of_the_samples():
    bridge = random_bridge(np.random.default_rng(1))
    distribution = sampled(bridge, Regions(WIDE.space, [[49.0, 49.0]], [[50.0, 50.0]]))
    rare = rare_violations(distribution, [0], samples=200)
    assert not rare.resolved[0]
    assert rare.upper[0] == pytest.approx(3 / distribution.diagnosis.effective)


def test_paths_that_come_nearest_at_their_start_are_led_on():
    """All begin upwards, and the region is below: it is a rise of what is mirrored."""
    bridge = hill(np.random.default_rng(2))
    passage, height = bridge.passage, bridge.passage.start[0] - 0.3
    goal = Box(-passage.goal.upper, -passage.goal.lower)
    mirrored = Bridge(replace(passage, start=-passage.start, goal=goal))
    exact = mirrored.chance_of_rise(-height, 4000, np.random.default_rng(1))
    below = Regions(WIDE.space, [[-50.0, -np.inf]], [[height, np.inf]])
    rare = rare_violations(sampled(bridge, below), [0])
    assert exact < 1e-4
    assert rare.resolved[0]
    assert abs(rare.phi[0] - exact) < 3 * np.hypot(rare.error[0], 0.03 * exact)


def test_the_limit_of_a_resolved_region_is_its_own():
    """Far below the one of the task's samples, of which three or so would have to cross."""
    bridge = hill(np.random.default_rng(2))
    distribution = sampled(bridge, above([bridge.passage.goal.upper[0] + 0.8]))
    rare = rare_violations(distribution, [0])
    assert rare.resolved[0]
    assert rare.upper[0] < 0.5 * 3 / distribution.diagnosis.effective
    np.testing.assert_allclose(rare.upper, rare.phi + ndtri(0.95) * rare.error, rtol=1e-3)


def test_a_probability_is_believed_with_enough_samples_and_a_light_tail():
    many, light = np.array([50.0, 50.0, 49.9, 49.9]), np.array([0.7, 0.71, 0.7, 0.71])
    rare = RareViolations(np.arange(4), *np.full((2, 4), 1e-4), many, light, np.full(4, 1e-3))
    assert rare.resolved.tolist() == [True, False, False, False]


def test_what_cannot_be_is_refused():
    system = Pendulum()
    somewhere = Predicate(lambda x: x[..., 1] > 5.0)
    regions = Regions.from_shapes(system.space, [somewhere], ["fast"])
    model = SampledModel(system, regions, 0.25, samples=200, restarts=1)
    task = Task(np.array([0.5, 0.0]), Box([0.4, -0.2], [0.6, 0.2]), 0.5)
    distribution = model.distribution(task)
    with pytest.raises(ValueError, match=r"numbered 0 to 0, not \[1\]"):
        rare_violations(distribution, [1])
    with pytest.raises(ValueError, match="at least 100 samples, not 5"):
        rare_violations(distribution, [0], samples=5)
    with pytest.raises(ValueError, match="region fast knows what is inside, but not how far"):
        rare_violations(distribution, [0])
    far = replace(task, goal=Box.point([3.0, 0.0]))
    nothing = replace(model, limit=Box([-0.01], [0.01])).distribution(far)
    with pytest.raises(ValueError, match="no sampled path reaches the goal"):
        rare_violations(nothing, [0])


def test_phi_is_no_more_than_1_where_a_region_is_not_rare() -> None:
    bridge = random_bridge(np.random.default_rng(1))
    start = bridge.passage.start
    around = Regions(WIDE.space, [start - 0.2], [start + 0.2])
    rare = rare_violations(sampled(bridge, around), [0], samples=1500)
    assert rare.phi[0] == rare.upper[0] == 1
