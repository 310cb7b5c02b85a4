"""Linked rigid bodies, against Lagrange's equations by differences and against closed forms."""

import numpy as np
import pytest

from mlci.mechanics.planar_chain import PlanarChain
from mlci.mechanics.rigid_chain import RigidChain
from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.shapes.predicates import InTaskSpace
from mlci.simulate import rollout
from mlci.system_check import check_affine, check_system
from mlci.systems import Pendulum
from tests.benchmark.two_link_arm import TwoLinkArm


def chain(links, seed=0, **options):
    rng = np.random.default_rng(seed)

    def some(low, high):
        return tuple(rng.uniform(low, high, links).tolist())

    given = dict(lengths=some(0.2, 0.5), masses=some(0.5, 2), centers=some(0.1, 0.3))
    given |= dict(inertias=some(0.01, 0.05), lower=(-2.0,) * links, upper=(2.0,) * links)
    given |= dict(speed_limits=(5.0,) * links, torques=some(0.5, 2))
    given |= dict(gravity=9.81, rotors=some(0, 0.3), drag=some(0, 0.2))
    return PlanarChain(**(given | options))


def random_states(links, count, seed=1):
    return np.random.default_rng(seed).normal(size=(count, 2 * links))


def plain_energies(body, angles, rates):
    """Kinetic and potential energy from positions of the masses, link by link."""
    nudge, kinetic, potential = 1e-6, 0.0, 0.0
    for link, mass in enumerate(body.masses):

        def place(q, link=link):
            theta, along = np.cumsum(q), [*body.lengths[:link], body.centers[link]]
            return sum(r * np.exp(1j * t) for r, t in zip(along, theta, strict=False))

        speed = (place(angles + nudge * rates) - place(angles - nudge * rates)) / (2 * nudge)
        turning = np.sum(rates[: link + 1])
        kinetic += mass * abs(speed) ** 2 / 2 + body.inertias[link] * turning**2 / 2
        kinetic += body.rotors[link] * rates[link] ** 2 / 2
        potential += mass * body.gravity * place(angles).real  # 0 is upright
    return kinetic, potential


@pytest.mark.parametrize("links", [1, 2, 3, 6])
def test_torques_are_those_of_lagranges_equations(links):
    # d/dt dT/dq' - dT/dq + dV/dq, all by differences of energies along a parabola q(t).
    system = chain(links, drag=())
    rng, step = np.random.default_rng(2), 1e-3
    angles, rates, bending = rng.normal(size=(3, links))
    accelerations = np.asarray(system.controls_for(np.append(angles, rates), bending))

    def lagrangian(q, v):
        kinetic, potential = plain_energies(system.body, q, v)
        return kinetic - potential

    def momentum(q, v):
        each = step * np.eye(links)
        return np.array([(lagrangian(q, v + e) - lagrangian(q, v - e)) / (2 * step) for e in each])

    later = momentum(angles + step * rates + step**2 / 2 * bending, rates + step * bending)
    sooner = momentum(angles - step * rates + step**2 / 2 * bending, rates - step * bending)
    force = (later - sooner) / (2 * step) - [
        (lagrangian(angles + e, rates) - lagrangian(angles - e, rates)) / (2 * step)
        for e in step * np.eye(links)
    ]
    np.testing.assert_allclose(accelerations * system.torques, force, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("links", [1, 2, 3, 6])
def test_a_chain_keeps_the_promises_of_a_system(links):
    system = chain(links)
    check_system(system)  # its Jacobians are those of differences
    check_affine(system)
    states = random_states(links, 50)
    controls = np.random.default_rng(3).normal(size=(50, links))
    bending = system.dynamics(states, controls)[:, links:]
    np.testing.assert_allclose(system.controls_for(states, bending), controls, atol=1e-11)


@pytest.mark.parametrize("links", [2, 3, 6])
def test_a_free_chain_keeps_its_energy_and_torques_do_their_work(links):
    # Runge-Kutta steps of 1 ms drift by the fifth power of the step: below 1e-6 of it here.
    system = chain(links, drag=())
    path = rollout(system, random_states(links, 1)[0], np.zeros((200, links)), 1e-3)
    assert np.ptp(system.energy(path)) < 1e-6 * np.ptp(path[:, :links])
    assert np.max(np.ptp(path, axis=0)) > 0.3
    dragged, states = chain(links), random_states(links, 20)
    controls = np.random.default_rng(4).normal(size=(20, links))
    rates = dragged.dynamics(states, controls)
    change = dragged.energy(states + 1e-6 * rates) - dragged.energy(states - 1e-6 * rates)
    torques = controls * dragged.torques - states[:, links:] * dragged.drag
    power = np.sum(torques * states[:, links:], axis=1)
    np.testing.assert_allclose(change / 2e-6, power, rtol=1e-5, atol=1e-5)


def test_one_link_is_the_pendulum():
    # Its mass at its end, so that the torque of a control of 1 turns m l^2 times that.
    length, mass, torque, drag = 0.7, 1.3, 0.9, 0.2
    inertia = mass * length**2
    link = PlanarChain(
        (length,), (mass,), (length,), (0.0,), (0.0,), (2 * np.pi,), (6.0,), (torque,), 2.0,
        gravity=9.81, drag=(drag * inertia,),
    )  # fmt: skip
    pendulum = Pendulum(gravity=9.81, length=length, drag=drag, mass=inertia / torque)
    states, controls = random_states(1, 30), np.linspace(-2, 2, 30)[:, None]
    given = link.dynamics(states, controls), *link.jacobians(states, controls)
    known = pendulum.dynamics(states, controls), *pendulum.jacobians(states, controls)
    for one, other in zip(given, known, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
    np.testing.assert_array_equal(link.space.periodic, pendulum.space.periodic)
    np.testing.assert_array_equal(link.space.bounds.upper, pendulum.space.bounds.upper)


def test_two_links_move_as_their_closed_form():
    arm = TwoLinkArm()
    outer = arm.outer - 0.5**2  # a forearm of 1 kg whose centre is 0.5 m out
    lengths = np.array([arm.coupled / 0.5, 1.0])
    inertias = np.array([arm.base - arm.outer - lengths[0] ** 2, outer])
    body = RigidChain(lengths, np.array([0.0, 1.0]), np.array([0, 0.5]), inertias, np.zeros(2), 0.0)
    states = np.random.default_rng(0).normal(size=(30, 6))
    known = arm.dynamics(states, np.zeros((30, 2)))[:, 2:4]
    found = body.accelerations(*(states[:, 2 * k : 2 * k + 2].T for k in range(3)))
    np.testing.assert_allclose(found.T, known, atol=1e-12)


def test_inertia_is_how_torques_rise_with_accelerations():
    system, state = chain(3, gravity=0.0), random_states(3, 1)[0]
    state[3:] = 0.0
    columns = [system.controls_for(state, push) * system.torques for push in np.eye(3)]
    np.testing.assert_allclose(system.body.inertia(state[:3]), np.transpose(columns), atol=1e-12)


def test_hand_and_centre_of_mass_lie_where_links_carry_them():
    system, states = chain(3), random_states(3, 40)
    theta = np.cumsum(states[:, :3], axis=1)
    joints = np.cumsum(system.lengths * np.exp(1j * theta), axis=1)
    hand = joints[:, -1]
    np.testing.assert_allclose(system.hand(states), np.c_[hand.imag, hand.real], atol=1e-12)
    first = np.c_[np.zeros(40), joints[:, :2]]
    middles = first + np.array(system.centers) * np.exp(1j * theta)
    center = middles @ np.array(system.masses) / np.sum(system.masses)
    expected = np.c_[center.imag, center.real]
    np.testing.assert_allclose(system.center_of_mass(states), expected, atol=1e-12)


@pytest.mark.parametrize("point", ["hand", "center"])
def test_a_straight_chain_is_as_steep_as_is_told(point):
    system = chain(3)
    place = {"hand": system.hand, "center": system.center_of_mass}[point]
    told = getattr(system, f"{point}_steepness")
    nudged = 1e-6 * np.eye(6)[:3]
    turned = (place(nudged) - place(-nudged)) / 2e-6
    assert np.linalg.svd(turned, compute_uv=False)[0] == pytest.approx(told, rel=1e-8)
    regions = Regions.from_shapes(system.space, [InTaskSpace(place, Ball([0.3, 0.4], 0.2), told)])
    bent = random_states(3, 200)
    near = np.linalg.norm(place(bent) - [0.3, 0.4], axis=1) < 0.2
    assert 0 < near.sum() < 200
    np.testing.assert_array_equal(regions.signed_distance(bent) < 0, near)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (dict(lengths=()), "at least one link"),
        (dict(masses=(1.0,)), "masses must have a value for each of 2 lengths, not 1"),
        (dict(drag=(1.0,)), "drag must have a value for each"),
        (dict(lengths=(0.3, -0.3)), "lengths must be positive"),
        (dict(inertias=(0.1, -0.1)), "inertias must be at least 0"),
        (dict(centers=(0.0, 0.1), inertias=(0.0, 0.1)), "a centre or an inertia above 0"),
        (dict(lower=(-2.0, 2.0)), "no more than a turn apart"),
        (dict(upper=(2.0, 9.0)), "no more than a turn apart"),
        (dict(gravity=np.nan), "gravity must be finite"),
        (dict(joints=("knee", "knee")), "joints must be different"),
        (dict(joints=("knee", "knee_speed")), "joints must be different"),
    ],
)
def test_a_chain_that_cannot_be_is_refused(options, words):
    with pytest.raises(ValueError, match=words):
        chain(2, **options)
