"""Study-level tables, against other ways to the same numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from experiments.collate.intervals import measures, rank_curve, resamples, study_tables

OPENING = {"truth": "c1", "cells": 400, "actions": 9, "dt": 0.25, "samples": 1}


def trials(*seeds: list[float], **opening: object) -> pd.DataFrame:
    """A group of `trials`: the errors of each seed's demonstrations."""
    return pd.concat(
        [
            pd.DataFrame({**OPENING, **opening, "seed": seed, "trial": range(len(each))}).assign(
                error=each
            )
            for seed, each in enumerate(seeds)
        ],
        ignore_index=True,
    )


def ranks(*seeds: list[float], size: int = 1) -> pd.DataFrame:
    """A group of `ranks`: the rank after each seed's subsets of one size."""
    return pd.concat(
        [
            pd.DataFrame(
                {**OPENING, "seed": seed, "demonstrations": size, "subset": range(len(each))}
            ).assign(reachable=1, rank=each, share_top_5=np.array(each) <= 5)
            for seed, each in enumerate(seeds)
        ],
        ignore_index=True,
    )


def test_one_seed_has_the_interval_of_the_ordinary_bootstrap() -> None:
    rng = np.random.default_rng(1)
    errors = rng.gamma(2.0, size=40)
    (row,) = measures(trials(list(errors))).to_dict("records")
    peer = stats.bootstrap(
        (errors,), np.mean, n_resamples=20_000, method="percentile", rng=np.random.default_rng(2)
    ).confidence_interval
    width = peer.high - peer.low
    assert row["mean"] == pytest.approx(errors.mean())
    # 1000 resamples place the ends within about a twentieth of the width (standard error 0.02).
    assert row["low"] == pytest.approx(peer.low, abs=0.08 * width)
    assert row["high"] == pytest.approx(peer.high, abs=0.08 * width)
    assert (row["measure"], row["seeds"], row["demonstrations"]) == ("error", 1, 40)


def test_interval_is_of_95_percent_of_the_means_of_resamples() -> None:
    errors = np.array([3.0, 1.0, 1.0, 8.0, 2.5, 30.0, 4.0])
    table = measures(trials(errors[:4].tolist(), errors[4:].tolist()))
    counts = resamples(np.array([4, 3]), ["c1", "400", "9", "0.25", "1"])
    means = [np.mean(np.repeat(errors, times)) for times in counts]
    expected = np.quantile(means, [0.025, 0.975])
    assert table.loc[0, ["low", "high"]].tolist() == pytest.approx(expected.tolist())


def test_interval_of_a_share_is_of_the_shares_of_resamples() -> None:
    rank = [5.0, 6.0, 1.0, 9.0, 2.0, 7.0]  # 5 is among the first 5
    table = rank_curve(ranks(rank[:3], rank[3:]))
    counts = resamples(np.array([3, 3]), ["c1", "400", "9", "0.25", "1", "1"])
    shares = [np.mean(np.repeat(np.array(rank) <= 5, times)) for times in counts]
    names = ["share_top_5", "share_top_5_low", "share_top_5_high"]
    expected = [3 / 6, *np.quantile(shares, [0.025, 0.975])]
    assert table.loc[0, names].tolist() == pytest.approx(expected)


def test_both_levels_vary_as_much_as_they_must() -> None:
    """Var* of the mean is (mean over seeds of (m_s - m)^2 + sigma_s^2 / N) / S, exactly."""
    rng = np.random.default_rng(3)
    values = rng.normal(size=(6, 25)) * rng.uniform(0.5, 3, (6, 1)) + rng.normal(size=(6, 1))
    counts = resamples(np.full(6, 25), ["any"])
    assert counts.shape == (1000, 150)
    assert (counts.sum(axis=1) == 150).all()
    found = counts @ values.ravel() / 150
    means = values.mean(axis=1)
    expected = np.mean((means - means.mean()) ** 2 + values.var(axis=1) / 25) / 6
    assert found.var() == pytest.approx(expected, rel=5 * np.sqrt(2 / 1000))
    assert found.mean() == pytest.approx(values.mean(), abs=5 * np.sqrt(expected / 1000))


def test_seeds_with_unlike_numbers_of_rows() -> None:
    counts = resamples(np.array([1, 4]), ["any"])
    # Two draws of a seed, each with as many rows as that seed has: 2, 5 or 8 rows in all.
    assert set(counts.sum(axis=1)) == {2, 5, 8}
    assert set(counts[counts.sum(axis=1) == 5, 0]) == {1}


def test_intervals_cover_the_truth_about_as_often_as_they_say() -> None:
    """Twelve seeds, each with an effect of its own; 95 % less what so few seeds cost."""
    rng = np.random.default_rng(4)
    groups = [
        trials(*(rng.normal(rng.normal(), 2.0, 10).tolist() for _ in range(12)), cells=number)
        for number in range(200)
    ]
    table = measures(pd.concat(groups))
    covered = np.mean((table["low"] <= 0) & (table["high"] >= 0))
    assert 0.87 <= covered <= 0.97


def test_a_demonstration_without_a_value_is_left_out() -> None:
    table = measures(
        pd.concat(
            [
                trials([2.0, np.nan, 4.0], [np.nan, np.nan, 6.0]),
                trials([np.nan, np.nan], cells=900),
                trials([7.0], cells=1600),
            ]
        )
    ).set_index("cells")
    some, none, one = (table.loc[cells] for cells in ("400", "900", "1600"))
    assert (some["mean"], some["demonstrations"], some["seeds"]) == (4.0, 3, 2)
    assert 2 <= some["low"] < 4 < some["high"] <= 6
    assert none[["mean", "low", "high"]].isna().all()
    assert (none["demonstrations"], none["seeds"]) == (0, 1)
    assert one[["mean", "low", "high"]].tolist() == [7.0] * 3


def test_truth_values_become_shares() -> None:
    table = trials([1.0, 2.0, 3.0, 4.0]).assign(reachable=[True, True, False, True])
    found = measures(table).set_index("measure")
    assert found.loc["reachable", "mean"] == 0.75
    assert found.loc["error", "mean"] == 2.5


def test_rank_curve_has_the_quantiles_of_all_seeds_together() -> None:
    one, two = [1.0, 2.0, 2.5, 9.0], [3.0, 5.0, 5.5, 40.0]
    table = rank_curve(pd.concat([ranks(one, two), ranks(two, one, size=2)]))
    assert table["demonstrations"].tolist() == [1, 2]
    for row in table.to_dict("records"):
        # Of 1, 2, 2.5, 3, 5, 5.5, 9, 40.
        assert row["median"] == 4.0
        assert (row["q25"], row["q75"]) == (2.375, 6.375)
        assert (row["q10"], row["q90"]) == pytest.approx((1.7, 18.3))
        assert (row["share_top_5"], row["seeds"]) == (5 / 8, 2)
        assert 1 <= row["median_low"] < 4 < row["median_high"] <= 40
        assert 0 <= row["share_top_5_low"] < 5 / 8 < row["share_top_5_high"] <= 1


def test_medians_of_resamples_are_those_of_the_drawn_rows() -> None:
    """Repeating each row as often as it was drawn, and taking the median of that."""
    rank = np.array([3.0, 1.0, 1.0, 8.0, 2.5, 30.0, 4.0])
    table = rank_curve(ranks(rank[:4].tolist(), rank[4:].tolist()))
    counts = resamples(np.array([4, 3]), ["c1", "400", "9", "0.25", "1", "1"])
    medians = [np.median(np.repeat(rank, times)) for times in counts]
    expected = np.quantile(medians, [0.025, 0.975])
    assert table.loc[0, ["median_low", "median_high"]].tolist() == expected.tolist()


def test_ranks_that_are_unknown_have_no_quantiles() -> None:
    table = rank_curve(ranks([np.nan, np.nan]))
    assert table[["median", "q10", "median_low", "median_high"]].isna().all(axis=None)
    known = rank_curve(ranks([np.nan, 3.0, 4.0]))
    assert known.loc[0, "median"] == 3.5
    assert 3 <= known.loc[0, "median_low"] <= known.loc[0, "median_high"] <= 4


def test_rows_depend_neither_on_their_order_nor_on_each_other() -> None:
    rng = np.random.default_rng(5)
    table = pd.concat(
        [
            trials(*rng.random((3, 8)).tolist(), cells=cells, actions=actions)
            for cells in (100, 400, 1600)
            for actions in (15, 5, "3x5")
        ]
    )
    whole = measures(table)
    pd.testing.assert_frame_equal(measures(table.sample(frac=1, random_state=0)), whole)
    part = measures(table[table["cells"] == 400])
    expected = whole[whole["cells"] == "400"].reset_index(drop=True)
    pd.testing.assert_frame_equal(part, expected)
    assert whole["cells"].unique().tolist() == ["100", "400", "1600"]
    assert whole["actions"].tolist()[:3] == ["5", "15", "3x5"]
    # The same values in another group meet other resamples.
    values = rng.random((3, 8)).tolist()
    one, two = measures(pd.concat([trials(*values, cells=cells) for cells in (1, 2)])).to_dict(
        "records"
    )
    assert one["mean"] == two["mean"]
    assert one["low"] != two["low"]


def test_rows_are_ordered_by_size() -> None:
    table = pd.concat([ranks([1.0], size=size) for size in (10, 2)])
    cells = pd.concat([table.assign(cells=cells) for cells in (1600, 400)])
    found = rank_curve(cells)
    assert found[["cells", "demonstrations"]].to_numpy().tolist() == [
        *(["400", 2], ["400", 10]),
        *(["1600", 2], ["1600", 10]),
    ]
    two = trials([1.0]).assign(zeal=1.0, angle=2.0)
    assert measures(two)["measure"].tolist() == ["error", "zeal", "angle"]


def test_each_number_of_demonstrations_has_resamples_of_its_own() -> None:
    rank = np.random.default_rng(6).random(40) * 50
    one, two = (ranks(rank[:20].tolist(), rank[20:].tolist(), size=size) for size in (1, 2))
    table = rank_curve(pd.concat([one, two]))
    assert table["median"].nunique() == 1
    assert table[["median_low", "median_high"]].drop_duplicates().shape == (2, 2)


def test_opening_columns_stay_as_they_are_spelt(tmp_path: Path) -> None:
    for name, table in {"trials": trials([1.0, 2.0]), "ranks": ranks([1.0, 2.0])}.items():
        table.insert(0, "tasks.lower", "[null, -2.0]")
        table.insert(0, "safety.margin", "")
        table.insert(0, "temperature", "1e-1")
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    paths = {name: tmp_path / f"{name}.csv" for name in ("trials", "ranks")}
    for table in study_tables(paths).values():
        (row,) = table.to_dict("records")
        assert (row["temperature"], row["safety.margin"]) == ("1e-1", "")
        assert (row["tasks.lower"], row["dt"]) == ("[null, -2.0]", "0.25")
        assert "seed" not in row


def test_a_study_without_a_table_lacks_what_is_made_of_it(tmp_path: Path) -> None:
    assert study_tables({}) == {}
    trials([1.0]).to_csv(tmp_path / "trials.csv", index=False)
    assert list(study_tables({"trials": tmp_path / "trials.csv"})) == ["measures"]
