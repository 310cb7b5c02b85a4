"""What is peculiar to single systems."""

from __future__ import annotations

import numpy as np

from mlci.simulate import rollout
from mlci.zoo.damped_spring import DampedSpring
from mlci.zoo.drag_mass import DragMass
from mlci.zoo.fuel_mass import FuelMass
from mlci.zoo.van_der_pol import VanDerPol


def test_every_path_of_van_der_pols_oscillator_ends_in_the_limit_cycle() -> None:
    """Averaging gives it an amplitude of 2, to first order in mu."""
    starts = np.array([[0.1, 0.0], [3.0, 0.0], [0.0, -3.0]])
    path = rollout(VanDerPol(), starts, np.zeros((3, 3000, 1)), 0.01)
    amplitude = np.max(np.abs(path[:, -1000:, 0]), axis=1)
    np.testing.assert_allclose(amplitude, 2.0, atol=0.02)
    np.testing.assert_allclose(amplitude, amplitude[0], atol=1e-4)  # of samples 0.01 s apart


def test_drag_works_against_motion_both_ways() -> None:
    path = rollout(DragMass(), [[0.0, 1.5], [0.0, -1.5]], np.zeros((2, 100, 1)), 0.02)
    np.testing.assert_allclose(path[0], -path[1], atol=1e-12)
    # v = v0 / (1 + c v0 t) where nothing pushes.
    np.testing.assert_allclose(path[0, -1, 1], 1.5 / (1 + 0.5 * 1.5 * 2.0), atol=1e-8)


def test_a_damped_spring_shrinks_volumes_at_the_rate_of_its_damping() -> None:
    corners = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])
    ends = rollout(DampedSpring(damping=3.0), corners, np.zeros((3, 100, 1)), 0.01)[:, -1]
    area = np.linalg.det(ends[1:] - ends[0])
    np.testing.assert_allclose(area, 0.01 * np.exp(-3.0), rtol=1e-6)


def test_fuel_is_paid_by_the_square_below_the_knee_and_by_size_above() -> None:
    mass = FuelMass(knee=0.5)
    small, large = np.array([1e-3]), np.array([1e3])
    np.testing.assert_allclose(mass.running_reward(np.zeros(2), small), -1e-6, rtol=1e-5)
    np.testing.assert_allclose(mass.running_reward(np.zeros(2), large), -1e3, rtol=1e-3)
