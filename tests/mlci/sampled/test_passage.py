import numpy as np
import pytest

from mlci.sampled.passage import Passage
from mlci.spaces import Box
from mlci.systems import Pendulum


def passage(**options) -> Passage:
    given = {"goal": Box([6.0, -0.1], [6.2, 0.1]), "steps": 4, "dt": 0.5} | options
    return Passage(Pendulum(), np.array([0.2, 0.0]), **given)


def test_the_density_is_the_reward_over_the_temperature():
    controls = np.array([[[1.0], [2.0], [0.0], [-1.0]]])
    of = passage(temperature=2.0)
    assert of.log_reward(np.zeros((1, 4, 2)), controls) == pytest.approx(-6 * 0.5 / 2)


def test_the_goal_is_met_by_any_winding_and_the_nearest_is_the_first():
    of = passage()
    np.testing.assert_allclose(of.nearest_goal, [6.1 - 2 * np.pi, 0.0])
    ends = np.array([[6.1, 0.0], [6.1 - 4 * np.pi, 0.05], [6.25, 0.0], [6.1, 0.2]])
    np.testing.assert_allclose(of.excess(ends), [0.0, 0.5, 1.5, 2.0], atol=1e-12)


def test_a_free_dimension_and_a_whole_turn_do_not_count():
    of = passage(goal=Box([-1.0, -np.inf], [6.0, np.inf]))
    assert of.excess(np.array([[3.0, 99.0]])) == 0
    np.testing.assert_array_equal(of.goal_price(0.7), [0.0, 0.0])


def test_a_gaussian_goal_has_a_share_of_the_half_width_for_deviation():
    price = passage(temperature=3.0).goal_price(0.5)
    np.testing.assert_allclose(3.0 / (2 * price), np.square([0.05, 0.05]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dt": 0.0}, "dt must be positive, not 0.0"),
        ({"goal": Box.point([1.0, 0.0])}, "needs width in each dimension"),
    ],
)
def test_a_passage_that_cannot_be_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        passage(**options)


def test_a_start_outside_the_space_is_refused():
    with pytest.raises(ValueError, match="outside the state space"):
        Passage(Pendulum(), np.array([0.0, 7.0]), Box([0.0, 0.0], [1.0, 1.0]), 4, 0.5)
