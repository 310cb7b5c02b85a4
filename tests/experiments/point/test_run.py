"""A whole point: its tables agree with each other, and its lines tell them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import rankdata
from tiny_point import composed, hopeless

from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point.baseline_tables import baseline_table
from experiments.point.inference import infer_point
from experiments.point.run import run_point
from experiments.point.streams import Purpose, stream
from experiments.point.tables import FIRST, PAPER_SIZE, opening_columns, table_bytes
from experiments.tracking.store import Store
from experiments.tracking.tables import rounded
from mlci.baselines import BASELINES
from mlci.evidence import PAPER
from mlci.metrics import random_subsets
from mlci.preparation import infer

WORDS = ["truth=wall", "horizon=4.0", "dt=0.5", "actions=3", "grid.shape=[16,8]"]
WORDS += ["safety.shape=[41,21]", "demonstrations.pairs=14", "demonstrations.keep=11"]
WORDS += ["demonstrations.restarts=1", "demonstrations.dt=0.05", "demonstrations.clip=true"]
WORDS += ["ranks.demonstrations=10", "ranks.subsets=6"]
WORDS += ["ranks.top=4", "rollouts=2", "baselines.paths=5"]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return Store(tmp_path_factory.mktemp("store"))


@pytest.fixture(scope="module")
def point(store: Store) -> tuple[Settings, dict, list[str]]:
    settings, lines = read_config(composed(*WORDS))[0], []
    tables = run_point(settings, store, lines.append)
    return settings, tables, lines


def test_the_summary_is_of_the_other_tables(point: tuple) -> None:
    _, tables, _ = point
    (row,) = tables["summary"].to_dict("records")
    trials, attempts, ranks = (tables[name] for name in ("trials", "attempts", "ranks"))
    outcomes = attempts["outcome"].value_counts()
    names = ("truth_entered", "bounds_left", "goal_missed", "kept")
    assert [row[name] for name in names] == [outcomes.get(name, 0) for name in names]
    assert row["pairs"] == len(attempts) == 14
    assert row["demonstrations"] == len(trials) == min(outcomes["kept"], 11)
    assert row["reachable"] == trials["reachable"].sum()
    assert row["feasible"] == trials["feasible"].sum()
    measures = ["final_state_error", "violation_distance", "violation_floor"]
    for name in (*measures, "violation_distance_pooled"):
        assert row[name] == pytest.approx(trials[name].mean(), rel=1e-12)
    after = ranks[ranks["demonstrations"] == PAPER_SIZE]
    assert row["rank_after_9"] == after["rank"].median()
    assert row["share_top_4_after_9"] == (after["rank"] <= 4).mean()


def test_ranks_are_in_the_top_up_to_the_last_place(point: tuple) -> None:
    """A rank of exactly `ranks.top` counts."""
    ranks = point[1]["ranks"]
    assert (ranks["rank"] == 4).any()
    np.testing.assert_array_equal(ranks["share_top_4"], (ranks["rank"] <= 4).astype(int))


def test_baselines_are_ranked_on_the_subsets_of_ranks(point: tuple) -> None:
    ranks, rows = point[1]["ranks"], point[1]["baselines"]
    assert rows["demonstrations"].unique().tolist() == [1, 3, 5, 9]
    for name, group in rows.groupby("demonstrations"):
        of_size, one = ranks[ranks["demonstrations"] == name], group.set_index("method")
        assert one.loc["ours", "rank"] == pytest.approx(of_size["rank"].mean())
        assert one.loc["ours", "top"] == pytest.approx(of_size["share_top_4"].mean())
        assert one.loc["ours", "first"] == pytest.approx((of_size["rank"] == 1).mean())
        assert len(one) == 6
    ours = rows[rows["method"] == "ours"]
    assert 0 < ours["top"].mean() < 1
    assert (rows.loc[rows["method"] == "uniform", "first"] == 0).all()
    assert rows["log_rank"].between(0, np.log(rows["rank"]) + 1e-12).all()


def test_baselines_are_ranked_by_the_library_on_each_subset_alone(
    point: tuple, store: Store
) -> None:
    """Those that draw nothing, and the paper's evidence, which goes from cell to cell."""
    settings, tables, _ = point
    asked = infer_point(settings, store)
    truth = asked.inference.hypotheses.inside(settings.constraint)
    table = tables["baselines"].set_index(["method", "demonstrations"])

    def scores(method: str, subset: np.ndarray) -> np.ndarray:
        some = [asked.demonstrations[j] for j in subset]
        if method == "paper":
            options = {"hypotheses": asked.hypotheses, "exact_ends": False, "rates": PAPER}
            return infer(asked.model, some, tolerance=np.inf, **options).gain
        score = BASELINES[method].score(asked.model, some, 0, np.random.default_rng(0))
        return score[asked.hypotheses]

    for size in (1, 3, 9):
        rng = stream(settings.seed, Purpose.SUBSETS, 0)
        subsets = random_subsets(len(asked.demonstrations), 9, 6, rng)[size - 1]
        for method in ("paper", "visits", "nearest", "uniform"):
            ordered = [rankdata(-scores(method, subset).round(9)) for subset in subsets]
            rank = np.array([each[truth].min() for each in ordered])
            expected = {"rank": rank.mean(), "log_rank": np.log(rank).mean()}
            expected |= {"top": (rank <= 4).mean(), "first": (rank == 1).mean()}
            assert table.loc[(method, size)].to_dict() == pytest.approx(expected), (method, size)
    assert table.groupby("demonstrations")["rank"].nunique().max() > 3  # methods can be told apart


def test_what_no_demonstration_could_avoid_but_by_the_truth_is_first(
    point: tuple, store: Store
) -> None:
    settings, asked = point[0], infer_point(point[0], store)
    truth = asked.inference.hypotheses.inside(settings.constraint)
    avoidance = np.where(truth, 1e-12, 0.9) * np.ones_like(asked.inference.avoidance)
    sure = dataclasses.replace(asked.inference, avoidance=avoidance)
    rows = baseline_table(settings, dataclasses.replace(asked, inference=sure))
    assert (rows.loc[rows["method"] == "ours", "first"] == 1).all()
    assert (rows.loc[rows["method"] == "uniform", "first"] == 0).all()


def test_first_are_the_first_five_and_probabilities_those_of_one_trial(point: tuple) -> None:
    _, tables, _ = point
    trials, ranking = tables["trials"], tables["hypotheses"]
    assert len(trials) > FIRST
    violations = tables["violations"].query("source == 'demonstration'")
    for name, count in (("hypotheses", len(trials)), ("first", FIRST)):
        of_these = violations[violations["trial"].isin(trials["trial"][:count])]
        counts = of_these["hypothesis"].value_counts()
        expected = [counts.get(i, 0) for i in range(len(ranking))]
        assert tables[name]["violating_demonstrations"].tolist() == expected
    example = tables["probabilities"]
    covered = ranking["covered_by_truth"].to_numpy()
    feasible = trials[trials["feasible"]]
    assert example["trial"].nunique() == 1
    chosen = feasible.set_index("trial").loc[example["trial"].iloc[0]]
    most = feasible["truth_probability"].max()
    assert chosen["truth_probability"] == pytest.approx(most, abs=1e-9)  # ties: the first
    assert (example["constrained"][covered] == 0).all()


def test_paths_and_their_times_are_every_fifth_sample(point: tuple) -> None:
    paths = point[1]["paths"]
    times = paths["time"][paths["demonstration"] == paths["demonstration"].iloc[0]]
    np.testing.assert_allclose(times, np.arange(17) * 5 * 0.05)


def test_lines_tell_the_answer_first_then_counts_diagnosis_and_measures(point: tuple) -> None:
    _, tables, lines = point
    (row,) = tables["summary"].to_dict("records")
    heads = [line.split("  ")[0] for line in lines if not line.startswith(" ")]
    once = [head for head in heads if head != "warning"]
    assert once == [
        "answer", "95 % credible", "assumed", "rests on",
        "calibration", "demonstrations", "discretisation", "measures",
    ]  # fmt: skip
    best = tables["hypotheses"].sort_values(["rank", "hypothesis"]).iloc[0]
    assert lines[0].startswith(
        f"answer          region {best['hypothesis']:.0f} is the most likely"
    )
    text = " ".join(" ".join(lines).split())
    assert f"{row['kept']} of 14 kept" in text
    assert f"final-state error {row['final_state_error']:.3f}" in text
    covered = int(tables["hypotheses"]["covered_by_truth"].sum())
    assert text.count("(truth)") <= covered
    assert max(map(len, lines)) <= 80


def test_rows_are_opened_by_the_point_and_numbers_rounded(point: tuple, tmp_path: Path) -> None:
    settings, tables, _ = point
    assert list(opening_columns("trials", settings)) == [
        "truth", "cells", "actions", "dt", "samples", "seed",
    ]  # fmt: skip
    assert opening_columns("paths", settings) == {"truth": "wall", "seed": 0}
    assert opening_columns("regions", settings) == {"truth": "wall"}
    path = tmp_path / "trials.csv"
    path.write_bytes(table_bytes("trials", tables["trials"], settings))
    read = pd.read_csv(path)
    assert read.iloc[0, :6].tolist() == ["wall", 128, 3, 0.5, 1, 0]
    pd.testing.assert_frame_equal(read.iloc[:, 6:], rounded(tables["trials"]), check_exact=True)
    pd.testing.assert_frame_equal(read.iloc[:, 6:], tables["trials"], rtol=1e-9, atol=0)
    own = pd.DataFrame({"seed": [5], "value": [1.5]})  # a column of the same name gives way
    assert table_bytes("regions", own, settings) == b"truth,seed,value\nwall,5,1.5\n"
    assert table_bytes("trials", own, settings).splitlines()[1] == b"wall,128,3,0.5,1,0,1.5"


def test_no_demonstration_is_told_with_the_outcomes(settings: Settings, tmp_path: Path) -> None:
    with pytest.raises(
        RuntimeError, match=r"no demonstration was kept: of 6 trials .* 6 missed the goal"
    ):
        run_point(hopeless(settings), Store(tmp_path), lambda line: None)


def test_no_more_demonstrations_than_asked_for(settings: Settings, tmp_path: Path) -> None:
    for keep in (1, 2):
        few = dataclasses.replace(settings.demonstrations, keep=keep)
        one = dataclasses.replace(settings, demonstrations=few)
        assert len(run_point(one, Store(tmp_path), lambda line: None)["trials"]) == keep


def test_the_rank_after_some_demonstrations_is_that_of_no_more(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiments.point.tables.PAPER_SIZE", 1)
    made = run_point(settings, Store(tmp_path), lambda line: None)
    ranks, (row,) = made["ranks"], made["summary"].to_dict("records")
    after = ranks[ranks["demonstrations"] == 1]
    assert len(after) < len(ranks)
    assert row["rank_after_1"] == after["rank"].median() != ranks["rank"].median()
