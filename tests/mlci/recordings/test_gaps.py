"""Gaps: bridged where the path hardly moves in them, refused where it may."""

import numpy as np
import pandas as pd
import pytest

from mlci.recordings.gaps import bridge_gaps
from mlci.systems import Pendulum

SPACE = Pendulum().space
WIDTHS = SPACE.bounds.widths / 20  # 0.314 rad, 0.6 rad/s


def frame(speed: float = 1.0) -> pd.DataFrame:
    """A second of an angle that rises through the seam, at 100 Hz."""
    time = np.arange(101) / 100
    angle = (6.0 + speed * time) % (2 * np.pi)
    return pd.DataFrame({"time": time, "angle": angle, "angular_velocity": speed + 0 * time})


def bridged(table: pd.DataFrame, share: float = 0.5) -> tuple[pd.DataFrame, list[str]]:
    return bridge_gaps(table, SPACE, share * WIDTHS, lambda row, name: f"line {row + 2}")


def test_a_whole_path_is_left_as_it_is() -> None:
    kept, notes = bridged(frame())
    pd.testing.assert_frame_equal(kept, frame())
    assert notes == []


def test_a_short_gap_is_bridged_through_the_seam() -> None:
    table = frame()
    table.loc[25:34, "angle"] = np.nan  # 6.25 to 6.34
    kept, notes = bridged(table)
    np.testing.assert_allclose(np.diff(SPACE.unwrap(kept[list(SPACE.names)]), axis=0)[:, 0], 0.01)
    assert notes == ["10 missing values of angle are bridged (line 27 first)"]


@pytest.mark.parametrize(
    ("share", "message"), [(0.5, "line 27 to line 44: angle is missing for 0.19 s"), (0.61, "")]
)
def test_a_long_gap_is_refused_unless_it_is_allowed(share: float, message: str) -> None:
    table = frame()
    table.loc[25:42, "angle"] = np.nan  # 0.19 rad, 0.605 of a cell
    if message:
        with pytest.raises(ValueError, match=message):
            bridged(table, share)
    else:
        assert len(bridged(table, share)[0]) == 101


def test_a_gap_in_which_the_path_turns_back_is_as_long_as_the_speed_beside_it_says() -> None:
    table = frame()
    table["angle"] = 1 + np.abs(table["time"] - 0.5)
    table.loc[41:59, "angle"] = np.nan  # there and back: the same angle on both sides
    with pytest.raises(ValueError, match=r"may move by 0\.2 rad"):
        bridged(table)


def test_rows_without_a_state_at_the_ends_are_left_out() -> None:
    table = frame()
    table.loc[:3, "angle"] = np.nan
    table.loc[99:, "angular_velocity"] = np.nan
    kept, notes = bridged(table)
    assert kept.index.tolist() == list(range(4, 99))
    assert notes == ["6 rows at the ends lack a state and are left out"]


def test_what_is_no_path_at_all_is_refused() -> None:
    with pytest.raises(ValueError, match="column 'angle' has no number"):
        bridged(frame().assign(angle=np.nan))
    table = frame()
    table.loc[::2, "angle"] = np.nan
    table.loc[1::2, "angular_velocity"] = np.nan
    with pytest.raises(ValueError, match="no row has a number for each of"):
        bridged(table)


def test_no_gap_is_bridged_where_none_may_be() -> None:
    """Not even in a dimension that stands still."""
    table = frame(0.0)
    table.loc[25, "angle"] = np.nan
    with pytest.raises(ValueError, match=r"line 27: angle is missing for 0\.02 s"):
        bridged(table, 0.0)


@pytest.mark.parametrize("way", [1, -1])
def test_the_speed_on_either_side_of_one_missing_sample_counts(way: int) -> None:
    """It moves on one side and stands still on the other."""
    table = frame()
    table["angle"] = (1 + np.minimum(table["time"], 0.49)).to_numpy()[::way]
    table.loc[50, "angle"] = np.nan
    with pytest.raises(ValueError, match=r"may move by 0\.02 rad"):
        bridged(table, 0.05)
