from dataclasses import replace

import numpy as np
import pytest

from mlci.demonstrations import Demonstration
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.models import forecasters
from mlci.preparation import infer, prepare
from mlci.rank_errors import RankErrors, infer_until_settled, rank_errors, sampling_record
from mlci.regions import Regions
from mlci.sampled.model import SampledModel
from mlci.sampling_errors import SamplingErrors
from mlci.simulate import rollout
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum
from mlci.tabular import discretize

PENDULUM = Pendulum()
BANDS = Regions.from_grid(PENDULUM.space, (4, 4))
MODEL = SampledModel(PENDULUM, BANDS, 0.25, samples=300, substeps=2, restarts=2)


def swing(torque: float, name: str) -> Demonstration:
    path = rollout(PENDULUM, [0.3, 0.0], [[torque]] * 100, 0.02)
    goal = Box(path[-1] - 0.1, path[-1] + 0.1)
    return Demonstration.from_path(path, 0.02, goal=goal, name=name)


SWINGS = [swing(0.4, "first"), swing(-1.0, "second")]


def inference_of(replicates: Floats) -> Inference:
    """Two demonstrations that violate nothing of three hypotheses."""
    regions = BANDS.select(np.arange(16) < 3)
    complaints = (), ("too few",)
    effective = np.array([500.0, 20.0])
    sampling = SamplingErrors(np.std(replicates, axis=0), replicates, complaints, effective)
    nothing = np.zeros((2, 3), dtype=bool)
    return Inference(
        *(regions, ("a", "b"), np.mean(replicates, axis=0), nothing, np.ones(2, dtype=bool)),
        sampling=sampling,
    )


def test_a_rank_is_settled_where_all_replicates_agree():
    rng, alpha = np.random.default_rng(0), np.array([[0.2, 0.5, 0.5], [0.2, 0.5, 0.51]])
    errors = rank_errors(inference_of(alpha + 0.02 * rng.uniform(-1, 1, (400, 2, 3))))
    np.testing.assert_array_equal(errors.settled, [True, False, False])
    np.testing.assert_array_equal(errors.lowest, [1, 2, 2])
    np.testing.assert_array_equal(errors.highest, [1, 3, 3])
    # The gain is -log of the product, whose relative error is that of alpha.
    relative = 0.02 / np.sqrt(3) * np.sqrt(np.sum(alpha**-2.0, axis=0))
    np.testing.assert_allclose(errors.gain_error, relative, rtol=0.1)


def test_errors_that_regions_share_leave_their_order_settled():
    rng = np.random.default_rng(0)
    shared = 0.05 * rng.uniform(-1, 1, (400, 2, 1))
    errors = rank_errors(inference_of(np.array([0.5, 0.51, 0.52]) + shared))
    assert np.all(errors.settled)


@pytest.mark.parametrize(("swapped", "settled"), [(1, True), (4, False)])
def test_the_middle_95_percent_of_ranks_count(swapped: int, settled: bool):
    alpha = np.tile([0.2, 0.3, 0.9], (100, 2, 1))
    alpha[:swapped] = [0.3, 0.2, 0.9]
    inference = inference_of(alpha)
    errors = rank_errors(inference)
    np.testing.assert_array_equal(errors.settled, [settled, settled, True])


def test_words_say_which_first_ranks_are_settled():
    names, order = ["a", "b", "c"], np.array([2, 0, 1])
    rank, nothing = np.array([2.0, 3.0, 1.0]), np.zeros(3)
    for highest, words in (
        ([2, 3, 1], "all 3 ranks are settled at 95 %"),
        ([2, 4, 1], "ranks 1-2 are settled at 95 %; region b, at rank 3, may have any from 3 to 4"),
        ([3, 3, 1], "rank 1 is settled at 95 %; region a, at rank 2, may have any from 2 to 3"),
        (
            [2, 3, 2],
            "no rank is settled at 95 % from the first on; region c, at rank 1, may have any from "
            "1 to 2",
        ),
    ):
        assert RankErrors(rank, rank, np.array(highest), nothing).summary(order, names) == words


def test_a_record_has_the_largest_error_and_what_any_demonstration_resolves():
    rng = np.random.default_rng(0)
    alpha = np.array([[0.5, 0.94, 0.5], [0.95, 0.95, 0.6]])
    noise = np.array([[0.02, 0.05, 0.01], [0.05, 0.04, 0.03]])
    inference = inference_of(alpha + noise * rng.choice([-1.0, 1.0], (400, 2, 3)))
    regions = sampling_record(inference, rank_errors(inference))["regions"]
    found = [regions[name] for name in inference.hypotheses.names]
    assert [each["resolved"] for each in found] == [True, False, True]
    assert [each["phi_error"] for each in found] == pytest.approx([0.05, 0.05, 0.03], rel=0.01)


def test_an_inference_from_samples_tells_of_its_errors():
    inference = infer(MODEL, SWINGS)
    assert inference.sampling is not None
    assert inference.sampling.replicates.shape == (200, 2, 16)
    assert inference.of([1]).sampling.complaints == inference.sampling.complaints[1:]
    few = infer(replace(MODEL, samples=60), SWINGS)
    assert any("samples of first are not to be believed" in line for line in few.warnings)
    assert not infer(replace(MODEL, samples=1500), SWINGS).warnings


def test_tasks_that_are_prepared_may_be_done_in_any_order():
    prepared = prepare(MODEL, [swing.task for swing in SWINGS], hypotheses=np.arange(16) < 8)
    paths = [swing.states for swing in reversed(SWINGS)]
    turned = prepared.infer(paths, 0.02, tasks=[1, 0])
    whole = infer(MODEL, SWINGS)
    np.testing.assert_array_equal(turned.avoidance, whole.avoidance[::-1, :8])
    np.testing.assert_array_equal(
        turned.sampling.replicates, whole.sampling.replicates[:, ::-1, :8]
    )


def test_samples_are_doubled_until_ranks_are_settled_or_the_budget_is_spent():
    attempts: list[int] = []
    inference, errors = infer_until_settled(
        MODEL, SWINGS, first=16, most=1200, progress=lambda count, _: attempts.append(count)
    )
    assert attempts in ([300], [300, 600], [300, 600, 1200])
    assert np.all(errors.settled[inference.order]) or attempts[-1] == 1200
    attempts.clear()
    infer_until_settled(MODEL, SWINGS, first=0, progress=lambda count, _: attempts.append(count))
    assert attempts == [300]


def test_a_tabular_ranking_has_no_errors_and_no_other_model_is_taken():

    grid = Grid(PENDULUM.space, (12, 12))
    tabular = discretize(PENDULUM, grid, np.array([[-2.0], [0.0], [2.0]]), 0.25, BANDS)
    inference = infer(tabular, SWINGS)
    assert inference.sampling is None
    assert np.all(rank_errors(inference).settled)
    with pytest.raises(ValueError, match="a sampled model has no cells"):
        infer(MODEL, SWINGS, exact_ends=False)
    with pytest.raises(TypeError, match="a TabularModel or a SampledModel"):
        forecasters(PENDULUM, [], round_horizon=False, exact_ends=True)


@pytest.mark.parametrize("options", [{"first": 1.5}, {"first": -1}, {"most": np.nan}])
def test_ranks_that_cannot_be_settled_are_refused(options):
    with pytest.raises(ValueError, match="is a whole number of at least 0"):
        infer_until_settled(MODEL, [], **options)
