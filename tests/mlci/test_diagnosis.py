"""The diagnosis of a discretisation, against counting by hand."""

import numpy as np
import pytest

from mlci.control.effort import WithEffort
from mlci.diagnosis import Diagnosis, diagnose
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Box
from mlci.systems import DoubleIntegrator, Pendulum
from mlci.tabular import action_grid, discretize


@pytest.mark.parametrize(
    ("cells", "dt", "frozen"),
    [(10, 0.1, True), (10, 0.2, True), (20, 0.1, True), (20, 0.25, False), (10, 0.5, False)],
)
def test_diagnosis_tells_a_grid_that_cannot_change_speed(
    cells: int, dt: float, frozen: bool
) -> None:
    """From a cell's middle, |u + sin| dt must exceed half a cell: 3 dt > 6 / cells, or nothing."""
    system = Pendulum()
    grid, actions = Grid(system.space, (cells, cells)), action_grid(system, 9)
    mdp = discretize(system, grid, actions, dt, Regions.from_grid(system.space, (2, 2)))
    diagnosis = diagnose(mdp)
    assert (diagnosis.frozen[1] > 0.9) == frozen


@pytest.mark.parametrize("at_once", [7, 1 << 17])
def test_diagnosis_counts_what_moves_do(monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    """Move by move, on a grid where many moves leave the bounds."""
    system = DoubleIntegrator()
    grid, actions = Grid(system.space, (5, 6)), action_grid(system, 3)
    mdp = discretize(system, grid, actions, 0.9, Regions.from_grid(system.space, (2, 2)))
    monkeypatch.setattr("mlci.tabular._MOVES_AT_ONCE", at_once)
    diagnosis = diagnose(mdp)
    stay, leave, changing = 0, 0, [set(), set()]
    for cell in range(grid.size):
        for move in range(3):
            end = int(mdp.kept.successor[cell, move])
            stay += end == cell
            leave += end < 0
            for d in range(2):
                if (
                    end >= 0
                    and np.unravel_index(end, (5, 6))[d] != np.unravel_index(cell, (5, 6))[d]
                ):
                    changing[d].add(cell)
    assert leave > 0
    assert diagnosis.leave == pytest.approx(leave / 90)
    assert diagnosis.stay == pytest.approx(stay / (90 - leave))
    assert diagnosis.frozen == pytest.approx([1 - len(cells) / 30 for cells in changing])
    speed = np.abs(grid.centers[:, 1])[:, None] * 0.9 / grid.widths[0]
    push = np.abs(actions[:, 0]) * 0.9 / grid.widths[1]
    assert diagnosis.cells_crossed == pytest.approx(np.mean(np.maximum(speed, push)))


def test_concerns_name_the_trouble_and_the_remedy() -> None:
    names = ("angle", "angular_velocity")
    assert Diagnosis(0.1, 0.0, 2.0, (0.1, 0.0)).concerns(names, 0, 20) == []
    frozen = Diagnosis(0.6, 0.0, 0.5, (0.2, 1.0)).concerns(names, 18, 22)
    assert "100% of the cells no action changes the angular velocity cell" in frozen[0]
    assert "18 of 22 goals cannot be reached" in frozen[1]
    assert "a longer time step, more cells" in frozen[2]
    lost = Diagnosis(0.0, 0.0, 19.0, (0.0, 0.0)).concerns(names, 13, 65)
    assert "13 of 65 goals cannot be reached" in lost[0]
    assert "more actions, a shorter step, or start points averaged" in lost[1]
    leaving = Diagnosis(0.0, 0.8, 9.0, (0.0, 0.0)).concerns(names, 0, 20)
    assert len(leaving) == 1
    assert "widen its bounds" in leaving[0]


@pytest.mark.parametrize(
    ("count", "dt", "noise"),
    [(9, 0.1, 0.146), (9, 0.2, 0.256), (9, 0.25, 0.298), (9, 0.5, 0.429), (9, 1.0, 0.493)],
)
def test_control_noise_is_less_where_actions_end_early(count: int, dt: float, noise: float) -> None:
    """Against sums by hand; without limits it is half the temperature."""
    system = Pendulum()
    regions = Regions.from_grid(system.space, (2, 2))
    model = discretize(system, Grid(system.space, (4, 4)), action_grid(system, count), dt, regions)
    diagnosis = diagnose(model)
    assert diagnosis.noise == pytest.approx((noise,), abs=5e-4)
    assert diagnosis.free_noise == pytest.approx((0.5,))


def test_control_noise_with_wide_actions_is_that_of_the_continuum() -> None:
    """25 actions in +-6, and at another temperature; a reward that does not bound the control."""
    system = Pendulum()
    wide = action_grid(system, 25, Box([-6.0], [6.0]))
    np.testing.assert_array_equal(wide[:, 0], np.linspace(-6, 6, 25))
    with pytest.raises(ValueError, match="1 controls need as many ranges, not 2"):
        action_grid(system, 5, Box([-1.0, -1.0], [1.0, 1.0]))
    grid, regions = Grid(system.space, (4, 4)), Regions.from_grid(system.space, (2, 2))
    for dt in (0.1, 0.2, 0.25, 0.5, 1.0):
        (noise,) = diagnose(discretize(system, grid, wide, dt, regions)).noise
        assert 0.478 <= round(noise, 3) <= 0.5
    hot = diagnose(discretize(system, grid, wide, 1.0, regions, temperature=3.0))
    assert hot.noise == pytest.approx(hot.free_noise, rel=0.01)
    assert hot.free_noise == pytest.approx((1.5,))
    plain = WithEffort(system, np.array([0.0, 0.0, -1.0]))  # no reward at all
    unbounded = diagnose(discretize(plain, grid, action_grid(plain, 5), 0.5, regions))
    assert np.isnan(unbounded.free_noise).all()
    assert unbounded.noise == pytest.approx((2.0 * 0.5,))  # of -2, -1, 0, 1, 2
