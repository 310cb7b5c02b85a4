"""A barrier in joint angles: what it promises, against motions that try to break it."""

import numpy as np
import pytest

from mlci.demonstrator import enters
from mlci.differences import first_derivatives
from mlci.mechanics.planar_chain import PlanarChain
from mlci.regions import Regions
from mlci.safety.joint_barrier import JointBarrier
from mlci.simulate import RK4
from mlci.spaces import Box
from mlci.systems import Pendulum

ARM = PlanarChain(
    *((0.3, 0.25, 0.2), (2.0, 1.2, 0.5), (0.15, 0.1, 0.1), (0.02, 0.01, 0.002)),
    *((-2.0,) * 3, (2.0,) * 3, (5.0,) * 3, (1.0, 0.4, 0.1)),
    gravity=9.81,
)
FREE = [-np.inf, np.inf]
HELD = 0.01  # short beside what the controls below change: 60 rad/s^2 for a hold are 0.006 rad


def boxes(*sides):
    """Regions of an arm's angles from pairs of bounds."""
    corners = [np.array([*side, *[FREE] * (6 - len(side))]).T for side in sides]
    return Regions.from_boxes(ARM.space, [Box(*corner) for corner in corners])


TRUTH = boxes([[0.2, 0.6], [-0.5, 0.1]], [FREE, [-1.2, -0.9], [0.3, 0.8]])
BARRIER = JointBarrier(ARM, TRUTH, HELD, (6.0, 8.0, 8.0), 0.02)


def test_who_brakes_one_joint_never_enters():
    # The promise of V: the best joint of a box, braked by a, keeps to its side, whatever others do.
    rng = np.random.default_rng(0)
    states = rng.uniform(ARM.space.bounds.lower, ARM.space.bounds.upper, (3000, 6))
    value = BARRIER.value(states)
    safe = states[(value >= 0) & (value < 0.2)]
    assert len(safe) > 200
    assert not TRUTH.violated_by(safe[:, None]).any()
    for number in range(len(TRUTH)):
        outcomes = []
        for joint in np.flatnonzero(np.isfinite(TRUTH.lower[number, :3])):
            rate, braking = safe[:, 3 + joint], BARRIER.braking[joint]
            stop = safe[:, joint] + rate * np.abs(rate) / (2 * braking)
            low, high = TRUTH.lower[number, joint], TRUTH.upper[number, joint]
            ends = np.sort([safe[:, joint], stop], axis=0)
            outcomes.append((ends[1] <= low) | (ends[0] >= high))
        assert np.all(np.any(outcomes, axis=0))


def test_who_moves_away_has_the_room_that_there_is():
    state = np.array([0.1, -0.2, 0.4, -3.0, 0.0, 0.0])  # 0.1 rad below the first box, going down
    barrier = JointBarrier(ARM, boxes([[0.2, 0.6]]), HELD, BARRIER.braking)
    assert barrier.value(state) == pytest.approx(0.1)
    state[3] = 1.0  # up to it, which takes 1 / 12 rad to brake
    assert barrier.value(state) == pytest.approx(0.1 - 1 / 12)


def test_no_control_enters_through_the_filter():
    # Strong controls towards K, changed at random; without the filter most of the paths enter.
    rng = np.random.default_rng(1)
    start = np.zeros((150, 6))
    start[:, :3] = rng.uniform(-1.5, 1.5, (150, 3))
    start = start[BARRIER.contains(start, 0.05)]
    aim = np.array([0.4, -0.4, 0.5])
    for guarded in (True, False):
        states, path, applied = start, [start], []
        for _ in range(150):
            towards = 30 * (aim - states[:, :3]) + rng.normal(0, 20, (len(states), 3))
            control = ARM.controls_for(states, towards)
            if guarded:
                control = BARRIER.apply(states, control)
            states = RK4.step(ARM, states, control, HELD)
            applied.append(control)
            path.append(states)
        found = enters(ARM, TRUTH, np.stack(path, 1), np.stack(applied, 1), HELD)
        assert found.any() != guarded
    assert found.mean() > 0.5


def test_a_control_that_leads_nowhere_near_passes():
    states, controls = np.zeros((2, 6)), np.ones((2, 3))
    states[:, 0] = -1.0, 0.1
    states[1, 3] = 1.0  # within a hold it could not be braked any more
    passed = BARRIER.apply(states, controls)
    np.testing.assert_array_equal(passed[0], controls[0])
    assert np.any(passed[1] != controls[1])
    bending = ARM.dynamics(states, controls)[1, 3:], ARM.dynamics(states, passed)[1, 3:]
    changed = np.abs(bending[1] - bending[0]) > 1e-9
    np.testing.assert_array_equal(changed, [True, False, False])  # the guard's joint alone


@pytest.mark.parametrize(
    "truth", [TRUTH, boxes([[0.2, 0.6]], [FREE, [-0.8, -0.3]])], ids=["one is near", "two are near"]
)
def test_its_derivatives_are_those_of_what_it_applies(truth):
    barrier = JointBarrier(ARM, truth, HELD, BARRIER.braking)
    states = np.zeros((1, 6))
    states[0] = 0.1, -0.2, 0.4, 1.0, -1.2, -0.2
    controls = np.array([[0.5, -0.3, 0.2]])
    by_state, by_control = barrier.linearize(states, controls)
    assert np.abs(by_state).max() > 1
    expected = first_derivatives(lambda x: barrier.apply(x, controls), states)
    np.testing.assert_allclose(by_state, expected, rtol=1e-5, atol=1e-5)
    expected = first_derivatives(lambda u: barrier.apply(states, u), controls)
    np.testing.assert_allclose(by_control, expected, rtol=1e-5, atol=1e-5)


def test_braking_takes_the_controls_that_it_says():
    state = np.array([0.3, 0.4, -0.5, 1.0, -2.0, 0.5])
    told = BARRIER.braking_controls(state)
    rest = ARM.dynamics(state, ARM.controls_for(state, np.zeros(3)))[3:]
    np.testing.assert_allclose(rest, 0, atol=1e-9)
    for joint, most in enumerate(BARRIER.braking):
        for sign in (-1, 1):
            control = ARM.controls_for(state, sign * most * np.eye(3)[joint])
            assert np.max(np.abs(control)) <= told[joint] + 1e-9


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(dt=0.0), "dt > 0"),
        (dict(margin=np.inf), "margin >= 0"),
        (dict(truth=Regions.from_grid(Pendulum().space, (2, 2))), "not of 2"),
        (dict(braking=(1.0, 1.0)), "positive deceleration of each joint"),
        (dict(truth=boxes([FREE, FREE, FREE, [0.0, 1.0]])), "joint angles at any rates"),
        (dict(truth=boxes([FREE, FREE, FREE])), "bounds no joint"),
    ],
)
def test_what_a_barrier_cannot_do_is_refused(change, words):
    given = dict(chain=ARM, truth=TRUTH, dt=HELD, braking=(1.0,) * 3) | change
    with pytest.raises(ValueError, match=words):
        JointBarrier(**given)


def test_a_joint_that_wraps_has_no_sides():
    wheel = PlanarChain((1.0,), (1.0,), (1.0,), (0.0,), (0.0,), (2 * np.pi,), (5.0,), (1.0,))
    truth = Regions.from_boxes(wheel.space, [Box([1.0, -np.inf], [2.0, np.inf])])
    with pytest.raises(ValueError, match="joints that wrap: joint_1"):
        JointBarrier(wheel, truth, HELD, (1.0,))


def test_a_single_state_is_filtered_as_one_of_many():
    states = np.zeros((2, 6))
    states[:, 0], states[1, 3] = 0.1, 1.0
    controls = np.ones((2, 3))
    passed, (by_state, by_control) = (
        BARRIER.apply(states, controls),
        BARRIER.linearize(states, controls),
    )
    for i in range(2):
        np.testing.assert_allclose(BARRIER.apply(states[i], controls[i]), passed[i])
        one_state, one_control = BARRIER.linearize(states[i], controls[i])
        np.testing.assert_allclose(one_state, by_state[i])
        np.testing.assert_allclose(one_control, by_control[i])
    assert np.any(passed[1] != controls[1])


def test_without_regions_everything_passes():
    free = JointBarrier(ARM, boxes(), HELD, BARRIER.braking)
    state, control = np.zeros(6), np.ones(3)
    np.testing.assert_array_equal(free.apply(state, control), control)
    by_state, by_control = free.linearize(state, control)
    np.testing.assert_array_equal(by_state, np.zeros((3, 6)))
    np.testing.assert_array_equal(by_control, np.eye(3))
    assert free.value(state) == np.inf


@pytest.mark.parametrize("shapes", [((1, 5), (1, 3)), ((1, 6), (1, 4)), ((3, 6), (2, 3)), ((), ())])
@pytest.mark.parametrize("call", [BARRIER.apply, BARRIER.linearize])
def test_shapes_that_do_not_fit_are_refused(call, shapes):
    with pytest.raises(ValueError, match=r"takes states \(\.\.\., 6\) and as many controls"):
        call(*map(np.zeros, shapes))
