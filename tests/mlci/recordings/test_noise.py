"""Noise and spikes that are put into smooth paths are found again, and none where there is none."""

import numpy as np
import pytest

from mlci.recordings.noise import Spike, noise, spikes
from mlci.simulate import rollout
from mlci.systems import Pendulum

SYSTEM = Pendulum()
TIME = np.arange(301) / 100
SMOOTH = rollout(SYSTEM, np.array([1.0, 0.5]), 1.5 * np.sin(3 * TIME[:-1, None]), 0.01)


@pytest.mark.parametrize("size", [0.0, 0.001, 0.05])
@pytest.mark.parametrize("even", [True, False])
def test_noise_is_told_from_the_path(size: float, even: bool) -> None:
    rng = np.random.default_rng(0)
    path = SMOOTH + rng.normal(0, 1, SMOOTH.shape) * [size, 2 * size]
    path[100] += 1.0  # one bad sample is no noise
    rows = np.arange(301) if even else np.sort(rng.choice(301, 200, replace=False))
    found = noise(path[rows], TIME[rows])
    np.testing.assert_allclose(found, [size, 2 * size], rtol=0.25, atol=1e-4)


def test_of_few_samples_no_noise_is_known() -> None:
    assert noise(SMOOTH[:6], TIME[:6]).tolist() == [0.0, 0.0]
    assert spikes(SYSTEM, SMOOTH[:6], TIME[:6]) == []


def test_a_sample_that_jumps_out_and_back_is_a_spike() -> None:
    path = SMOOTH.copy()
    path[150] += [2.0, 0.0]
    path[200:203] -= [0.0, 4.0]
    found = spikes(SYSTEM, path, TIME)
    assert [(each.first, each.last, each.dimension) for each in found] == [
        (150, 150, 0),
        (200, 202, 1),
    ]
    assert found[0].size == pytest.approx(2.0, abs=0.1)
    assert found[1].size == pytest.approx(4.0, abs=0.2)


@pytest.mark.parametrize("noise_size", [0.0, 0.03, 0.5])
def test_smooth_and_noisy_paths_have_no_spikes(noise_size: float) -> None:
    rng = np.random.default_rng(2)
    found: list[Spike] = []
    for start in ([0.0, 0.0], [3.0, 2.0], [5.0, -3.0]):
        hard = np.sign(np.sin(7 * TIME[:-1, None])) * 2.0  # as fast as controls can turn it
        path = rollout(SYSTEM, np.array(start), hard, 0.01)
        found += spikes(SYSTEM, path + rng.normal(0, noise_size, path.shape), TIME)
    assert found == []


def test_where_many_samples_stand_out_none_is_a_spike() -> None:
    path = SMOOTH.copy()
    path[10::12] += [2.0, 0.0]
    assert spikes(SYSTEM, path, TIME) == []


def test_a_path_that_jumps_and_stays_is_no_spike() -> None:
    path = SMOOTH.copy()
    path[150:] += [2.0, 0.0]
    assert spikes(SYSTEM, path, TIME) == []


@pytest.mark.parametrize("row", [0, 300])
def test_a_sample_at_an_end_does_not_jump_out_and_back(row: int) -> None:
    """Where a path begins or ends elsewhere, its end may be what is right."""
    path = SMOOTH.copy()
    path[row] += [2.0, 0.0]
    assert spikes(SYSTEM, path, TIME) == []
