"""The report, on tables made up so that its verdicts are known."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from html.parser import HTMLParser
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from experiments.config.paths import CHECKOUT
from experiments.tracking.files import digest
from experiments.tracking.sealed import write_sealed
from experiments.tracking.study import Collated, Study
from paper_figures.report import __main__ as command_line
from paper_figures.report import (
    claim_1,
    claim_2,
    claim_3,
    claim_4,
    claim_5,
    claim_6,
    earlier,
    markdown,
    page,
    section_beliefs,
    section_choices,
    section_control_noise,
    section_costs,
    section_evidence,
    section_start_points,
)
from paper_figures.report.chapters import SECTIONS
from paper_figures.report.document import report
from paper_figures.report.means import Mean, share
from paper_figures.report.study_tables import Missing, Results
from paper_figures.report.verdict import Check, Claim, Part, Verdict

TRUTHS, CELLS, STEPS = ("c1", "c2"), (100, 400, 900, 1600), (0.1, 0.2, 0.25, 0.5, 1.0)
SETTINGS = [
    {"truth": truth, "cells": cells, "actions": number, "dt": dt, "samples": 1}
    for truth, cells, number, dt in product(TRUTHS, CELLS, (5, 9, 15), STEPS)
]


def error(setting: dict) -> float:
    """As the paper says: falls with cells, hardly past 900, and with dt."""
    return 0.2 / np.sqrt(min(setting["cells"], 900 + setting["cells"] / 100)) + 0.01 / setting["dt"]


def measure_rows() -> pd.DataFrame:
    """All that the paper claims of errors and distances."""
    rows = []
    for setting in SETTINGS:
        values = {
            "final_state_error": error(setting),
            "violation_distance": 8.0 if setting["cells"] > 100 else 11.0,
            "violation_floor": 7.0,
            "violation_distance_pooled": 2.0,
            "reachable": 1.0,
        }
        for name, mean in values.items():
            ends = {"mean": mean, "low": mean * 0.999, "high": mean * 1.001}
            counts = {"seeds": 5, "demonstrations": 325}
            rows.append({**setting, "measure": name, **ends, **counts})
    return pd.DataFrame(rows)


def failing(setting: dict) -> bool:
    return setting["cells"] == 100 and setting["dt"] == 0.2


def curve_rows() -> pd.DataFrame:
    """The truth is found everywhere but with 100 cells at dt 0.2 s."""
    rows = []
    for setting in SETTINGS:
        found = not failing(setting)
        ranks = {"median": 2.0 if found else 26.5, "q10": 1.0, "q90": 6.0 if found else 40.0}
        ranks |= {"median_low": ranks["median"] - 1, "median_high": ranks["median"] + 1}
        part = 0.8 if found else 0.0
        shares = {
            "share_top_5": part,
            "share_top_5_low": part * 0.9,
            "share_top_5_high": part * 1.1,
        }
        rows += [
            {**setting, "demonstrations": size, **ranks, **shares, "seeds": 5} for size in (5, 9)
        ]
    return pd.DataFrame(rows)


def summary_rows() -> pd.DataFrame:
    """A point a setting; most moves stay where the paper says so."""
    rows = []
    for setting in SETTINGS:
        for seed in (0, 1) if setting["actions"] == 9 else (0,):
            rows.append(
                {
                    **setting,
                    "seed": seed,
                    "demonstrations": 65,
                    "reachable": 65,
                    "final_state_error": error(setting) * (1 + setting["actions"] / 1000),
                    "violation_distance": 8.0 + setting["actions"] / 100,
                    "rank_after_9": 2.0,
                    "share_top_5_after_9": 0.8,
                    "stay": 0.9 if failing(setting) else 0.1,
                    "frozen_angle": 0.0,
                    "frozen_angular_velocity": 1.0 if failing(setting) else 0.0,
                }
            )
    return pd.DataFrame(rows)


def attempt_rows(lost: int) -> pd.DataFrame:
    outcome = ["goal_missed"] * lost + ["kept"] * (100 - lost)
    each = pd.DataFrame({"outcome": outcome, "peak_control": np.linspace(0, 4, 100)})
    return pd.concat([each.assign(truth=truth, seed=seed) for truth in TRUTHS for seed in range(5)])


def write(folder: Path, study: str, **tables: pd.DataFrame) -> None:
    (folder / study / "tables").mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        table.to_csv(folder / study / "tables" / f"{name}.csv", index=False)
    paths = (folder / study / "tables").iterdir()
    collated = {
        "points": ["b" * 32, "a" * 32],
        "sources": {"5f" * 32: 2},
        "commits": ["c0ffee" * 6],
        "dirty": False,
        "started": ["2026-01-01T10:00:00.000+00:00", "2026-01-01T10:05:00.000+00:00"],
        "seconds": 60.0,
        "peak_memory_mb": 123,
        "machines": ["a machine"],
        "versions": ["numpy 0.1"],
        "systems": ["mlci.systems"],
        "made_by": "",
        "tables": {path.name: digest(path.read_bytes()) for path in paths},
    }
    write_sealed(folder / study / "study.json", {"points": {}, "collated": collated})


@pytest.fixture
def results(tmp_path: Path) -> Results:
    """A study that shows exactly what the paper claims."""
    tables = {"measures": measure_rows(), "rank_curve": curve_rows(), "summary": summary_rows()}
    write(tmp_path, "paper", **tables, attempts=attempt_rows(35))
    return Results(tmp_path)


def changed(results: Results, name: str, where: pd.Series, **values: object) -> Results:
    """The same results with some values of a table of the paper's study changed."""
    table = results.table("paper", name).copy()
    for column, value in values.items():
        table.loc[where, column] = value
    write(results.folder, "paper", **{name: table})
    return Results(results.folder)


def parts(claim: Claim) -> list[tuple[int, int]]:
    return [(part.holding, len(part.checks)) for part in claim.parts]


def test_a_part_and_a_claim_are_judged_by_their_settings() -> None:
    def part(*holds: bool) -> Part:
        return Part("s", "r", [Check("x", each) for each in holds])

    yes, half, no = part(True, True), part(True, False), part(True, False, False)
    assert [each.verdict for each in (yes, half, no)] == list(Verdict)
    for found, expected in [
        ([yes, yes], Verdict.REPRODUCED),
        ([yes, half], Verdict.PARTLY),
        ([yes, no], Verdict.PARTLY),
        ([half, no], Verdict.PARTLY),
        ([no, no], Verdict.NOT),
    ]:
        assert Claim("t", "p", found, "", "", "c").verdict is expected
    with pytest.raises(ValueError, match="no setting to check in: s"):
        Part("s", "r", [])


def test_what_differs_from_the_first_report_is_told() -> None:
    def claim(title: str, statement: str, holding: int, of: int) -> Claim:
        checks = [Check(str(i), i < holding) for i in range(of)]
        return Claim(title, "", [Part(statement, "", checks)], "", "", "")

    same = claim("Final-state error", "little gain past 900 cells", 4, 10)
    one = claim("Pairs that become demonstrations", "65 of 100 pairs are kept", 2, 2)
    text = earlier.changes([one, Missing("paper", ""), same])
    assert "claim 1, not reproduced to reproduced" in text
    assert "65 of 100 pairs are kept (0 of 2 to 2 of 2)." in text
    assert "Final-state" not in text
    assert "little gain" not in text
    partly = claim("Violation distance", "flat in dt", 4, 6)
    assert earlier.changes([partly]).startswith("No verdict differs")
    other = claim("Violation distance", "flat in dt", 5, 6)
    assert "differ from version 0.1.0's: none." in earlier.changes([other])


def test_a_share_has_wilsons_interval() -> None:
    for part, whole in [(0, 10), (65, 100), (487, 500), (7, 7)]:
        peer = stats.binomtest(part, whole).proportion_ci(0.95, method="wilson")
        found = share(part, whole)
        assert found.value == part / whole
        assert (found.low, found.high) == pytest.approx((peer.low, peer.high), abs=1e-4)


def test_a_mean_is_lower_only_if_the_intervals_are_apart() -> None:
    low, high, wide = Mean(1, 0.9, 1.1), Mean(2, 1.9, 2.1), Mean(2, 1.05, 3)
    nothing = Mean(np.nan, np.nan, np.nan)
    assert low.lower_than(high)
    assert not high.lower_than(low)
    assert not low.lower_than(wide)
    assert not low.lower_than(nothing)
    assert not nothing.lower_than(low)
    assert str(nothing) == "-"


def test_what_the_paper_claims_is_reproduced_by_tables_that_show_it(results: Results) -> None:
    for write_claim in (claim_1.claim, claim_2.claim, claim_3.claim, claim_4.claim, claim_5.claim):
        claim = write_claim(results)
        assert claim.verdict is Verdict.REPRODUCED, [(p.statement, p.checks) for p in claim.parts]


def test_claim_1_fails_where_other_numbers_of_pairs_are_kept(results: Results) -> None:
    write(results.folder, "paper", attempts=attempt_rows(5))
    claim = claim_1.claim(Results(results.folder))
    assert claim.verdict is Verdict.NOT
    assert "95 % [93, 97 %]" in claim.numbers
    assert "Of the 50 pairs that are lost, 50 are `goal missed`" in claim.why


def test_claim_2_counts_the_settings_that_do_not_saturate_or_have_no_value(
    results: Results,
) -> None:
    rows = results.table("paper", "measures")
    own = (rows["measure"] == "final_state_error") & (rows["truth"] == "c1") & (rows["dt"] == 0.5)
    fine = changed(
        results, "measures", own & (rows["cells"] == 1600), mean=0.001, low=0, high=0.002
    )
    assert parts(claim_2.claim(fine)) == [(10, 10), (9, 10), (8, 8)]
    none = changed(
        results, "measures", own & (rows["cells"] == 100), mean=None, low=None, high=None
    )
    claim = claim_2.claim(none)
    assert parts(claim) == [(9, 10), (9, 10), (8, 8)]
    assert "C1, dt 0.5 (- to " in claim.markdown()


def test_claim_3_counts_each_part_apart(results: Results) -> None:
    rows = results.table("paper", "measures")
    own = (rows["measure"] == "violation_distance") & (rows["truth"] == "c2")
    where = own & (rows["cells"] == 900) & (rows["dt"] == 0.1)
    found = claim_3.claim(changed(results, "measures", where, mean=10.0))
    assert parts(found) == [(10, 10), (19, 20), (5, 6)]
    assert "C2, 900 cells, dt 0.1 (+25%)" in found.markdown()
    where = own & (rows["cells"] == 400) & (rows["dt"] == 0.1)
    lost = changed(results, "measures", where, mean=None, low=None, high=None)
    assert parts(claim_3.claim(lost)) == [(9, 10), (18, 20), (5, 6)]


def test_claim_4_wants_median_and_share(results: Results) -> None:
    rows = results.table("paper", "rank_curve")
    nine = (rows["demonstrations"] == 9) & (rows["actions"] == 9) & (rows["truth"] == "c1")
    where = nine & (rows["cells"] == 900) & (rows["dt"] == 0.5)
    assert parts(claim_4.claim(changed(results, "rank_curve", where, median=5.5)))[3] == (29, 30)
    claim = claim_4.claim(changed(results, "rank_curve", where, median=2, share_top_5_low=0.49))
    assert parts(claim) == [(8, 8), (2, 2), (2, 2), (29, 30)]
    bad = changed(results, "rank_curve", nine & (rows["cells"] == 100), median=30)
    assert parts(claim_4.claim(bad))[0] == (7, 8)
    stay = results.table("paper", "summary")["cells"] == 100
    claim = claim_4.claim(changed(results, "summary", stay, stay=0.2))
    assert parts(claim)[2] == (0, 2)
    assert "| 100, 0.2 s | 20 % | 0 % | 100 % | 260 of 260 |" in claim.why


def test_claim_5_compares_on_the_same_demonstrations(results: Results) -> None:
    rows = results.table("paper", "summary")
    where = (rows["actions"] == 9) & (rows["seed"] == 1)  # another seed than 5 and 15 actions have
    same = claim_5.claim(changed(results, "summary", where, violation_distance=99.0))
    assert same.verdict is Verdict.REPRODUCED
    where = (rows["actions"] == 5) & (rows["dt"] == 1.0) & (rows["truth"] == "c1")
    claim = claim_5.claim(changed(results, "summary", where, violation_distance=16.18))
    assert parts(claim) == [(80, 80), (76, 80), (80, 80), (80, 80)]
    assert "5 actions, C1, 400 cells, dt 1 (+100 %)" in claim.markdown()
    assert "| 5 actions | 32 of 32 | 32 of 32 | 32 of 32 | 32 of 32 | 28 of 32 |" in claim.why


def telescope_tables() -> dict[str, pd.DataFrame]:
    """The default and another case of both kinds of tasks; random tasks hold half the evidence."""
    opening = {"truth": "pain", "cells": 2500, "actions": "5x3", "dt": 0.5}
    rows, curve, means = [], [], []
    for samples, cross in product((2, 1), (False, True)):
        row = {"tasks.crossing": cross, **opening, "samples": samples}
        case = "default" if samples == 2 else "start points in a cell: 1"
        rows.append({**row, "case": case, "choice": case, "value": ""})
        chance = 0.5 if cross else 0.25
        means.append({**row, "measure": "truth_probability", "mean": chance})
        for size in (5, 10, 20):
            part = 0.8 + 0.005 * size * chance
            shares = {
                f"{name}{end}": value
                for name in claim_6.SHARES
                for end, value in (("", part), ("_low", 0.6), ("_high", 0.95))
            }
            curve.append({**row, "demonstrations": size, "median": 1.5, **shares})
    return {
        "cases": pd.DataFrame(rows),
        "rank_curve": pd.DataFrame(curve),
        "measures": pd.DataFrame(means),
    }


def test_claim_6_wants_both_best_hypotheses_and_the_time(tmp_path: Path) -> None:
    tables = telescope_tables()
    write(tmp_path, "telescope", **tables)
    claim = claim_6.claim(Results(tmp_path))
    assert claim.verdict is Verdict.REPRODUCED
    assert [part.statement for part in claim.parts[:2]] == [
        "the best two overlap the truth after 5 demonstrations of random tasks",
        "the best two overlap the truth after 5 demonstrations of tasks that cross the truth",
    ]
    assert parts(claim) == [(2, 2), (2, 2), (2, 2), (2, 2), (1, 1)]
    curve = tables["rank_curve"]
    where = curve["tasks.crossing"] & (curve["samples"] == 1) & (curve["demonstrations"] == 5)
    curve.loc[where, "top_2_overlap_low"] = 0.4
    curve.loc[where, "top_2_inside_low"] = 0.5
    write(tmp_path, "telescope", **tables)
    claim = claim_6.claim(Results(tmp_path))
    assert parts(claim) == [(2, 2), (1, 2), (2, 2), (2, 2), (1, 1)]
    assert claim.verdict is Verdict.PARTLY
    assert "does not hold: start points in a cell: 1 (81 % [40, 95 %])." in claim.markdown()


def test_claim_6_compares_sets_of_equal_evidence(tmp_path: Path) -> None:
    """20 random demonstrations at 0.25 hold as much as 10 others at 0.5."""
    write(tmp_path, "telescope", **telescope_tables())
    why = claim_6.claim(Results(tmp_path)).why
    assert "20 random demonstrations hold as much evidence (5.0) as 10 of tasks that cross" in why
    assert "with the share that overlaps is 1.0, and with the share inside 1.0." in why
    assert "after the former 82 % of the sets overlap and 82 % lie inside, after the latter " in why


def test_sensitivity_counts_where_the_truth_is_found_in_each_case(results: Results) -> None:
    some = "cells in (100, 400) and actions == 9 and dt in (0.2, 0.25)"
    names = {"default": 1.0, "temperature: 4": 4.0}
    opening = ["temperature", "truth", "cells", "actions", "dt", "samples"]

    def both(rows: pd.DataFrame) -> pd.DataFrame:
        parts = [rows.query(some).assign(temperature=value) for value in names.values()]
        rows = pd.concat(parts, ignore_index=True)
        return rows[[*opening, *(name for name in rows if name not in opening)]]

    ranks, means, summary = both(curve_rows()), both(measure_rows()), both(summary_rows())
    ranks.loc[(ranks["temperature"] == 4) & (ranks["truth"] == "c2"), "median"] = 12.0
    cases = ranks[opening].drop_duplicates()
    words = {value: name for name, value in names.items()}
    cases = cases.assign(case=cases["temperature"].map(words), choice="", value="")
    summary = summary.assign(pairs=100, kept=np.where(summary["temperature"] == 4, 70, 90))
    tables = {"cases": cases, "rank_curve": ranks, "measures": means, "summary": summary}
    write(results.folder, "sensitivity", **tables)
    found = Results(results.folder)
    text = section_choices.section(found)
    # Of two truths, two grids and two dt, 100 cells at dt 0.2 s fail in any case.
    assert "| default | 6 of 8 |" in text
    assert "| temperature: 4 | 3 of 8 |" in text
    assert text.count(", 400 cells, dt 0.25 |") == 4
    assert ", 100 cells" not in text
    assert "| temperature: 4 | 70 % | 70 % |" in claim_1.claim(found).why
    write(results.folder, "sensitivity", cases=cases[cases["case"] != "default"])
    with pytest.raises(Missing, match="has no case 'default'"):
        section_choices.section(Results(results.folder))


def test_calibration_counts_bins_that_agree(tmp_path: Path) -> None:
    rows = [
        # lower, upper, predicted, observed, low, high, weight, count
        (0.0, 0.5, 0.2, 0.3, 0.1, 0.4, 0.5, 50),
        (0.5, 1.0, 0.8, 0.4, 0.3, 0.5, 0.25, 50),
        (0.5, 1.0, 0.9, 0.9, 0.8, 0.95, 0.0, 19),
        (1.0, np.inf, 3.0, 0.1, 0.0, 0.2, 0.25, 30),
    ]
    names = ["lower", "upper", "predicted", "observed", "low", "high", "weight", "count"]
    table = pd.DataFrame(rows, columns=names)
    table = table.assign(source="model", demonstrations=3, belief="selected")
    write(tmp_path, "calibration", reliability=table)
    text = section_beliefs.section(Results(tmp_path))
    # Two thirds of the probabilities at 0.2 and one at 0.8: 0.4; right 1/3; off 0.1 and 0.4: 0.2.
    assert "| 3 | 0.400 | 0.333 | 0.200 | 1 of 2 | 25 % |" in text
    assert "most likely one, exact posterior" in text


def test_evidence_is_compared_and_judged(tmp_path: Path) -> None:
    scores = dict.fromkeys(section_evidence.SCORES, 0.02)
    rows = [
        {"demonstrations": size, "evidence": kind, "worlds": 120, "sets": 200, "best": 0.1}
        | {"right": right, "by_chance": 0.015, "by_chance_high": 0.03}
        | {f"{name}{end}": value for name, value in scores.items() for end in ("", "_low", "_high")}
        for size, right in ((5, 0.1), (10, 0.1), (20, 0.3))
        for kind in ("paper", "calibrated", "model error 0.1")
    ]
    table = pd.DataFrame(rows)
    write(tmp_path, "calibration", evidence_kinds=table)
    text = section_evidence.section(Results(tmp_path))
    line = "| calibrated | 5 | 0.100 | 0.100 | 0.020 [0.020, 0.020] | 0.015 (95 %: 0.030) |"
    assert line in text
    assert "off by 0.0200 after 5, 0.0200 after 10 demonstrations, within 0.05." in text
    assert "After 20 it is too modest (0.100 probable, 0.300 right)" in text
    table.loc[table["demonstrations"] == 10, "off_by"] = 0.07
    write(tmp_path / "worse", "calibration", evidence_kinds=table)
    worse = section_evidence.section(Results(tmp_path / "worse"))
    assert "0.0700 after 10 demonstrations, not within 0.05." in worse
    assert "is off by 0.0200 after 5, 0.0700 after 10 demonstrations, within 0.07." in worse


def test_control_noise_explains_what_changes_with_few_actions_alone(tmp_path: Path) -> None:
    change = {9: (0.8, 0.4), 25: (0.4, 0.3)}  # at dt 0.1 and 1 s
    setting = {"truth": "c1", "cells": 400}
    rows = [
        {**setting, "actions": count, "dt": dt, "measure": name}
        | {"mean": mean, "low": mean - 0.01, "high": mean + 0.01}
        for name in section_control_noise.MEASURES
        for count, means in change.items()
        for dt, mean in zip((0.1, 1.0), means, strict=True)
    ]
    noise = [
        {**setting, "actions": count, "dt": dt, "noise_1": value, "free_noise_1": 0.5}
        for count, dt, value in ((9, 0.1, 0.15), (9, 1.0, 0.49), (25, 0.1, 0.48), (25, 1.0, 0.49))
    ]
    tables = {"measures": pd.DataFrame(rows), "summary": pd.DataFrame(noise)}
    write(tmp_path, "control_noise", **tables)
    text = section_control_noise.section(Results(tmp_path))
    assert "C1 at 400 cells -50 % and -25 %" in text
    # log 2 against log 4 / 3.
    assert "the noise explains 58 % of that" in text
    assert "| C1 | 400 | 0.1 s | 0.150 | 0.480 | 0.800 [0.790, 0.810] | 0.400 [0.390" in text
    # With the noise held the change is the larger one: log 4 / 3 against log 2.
    swapped = tables["measures"].assign(actions=tables["measures"]["actions"].map({9: 25, 25: 9}))
    write(tmp_path / "swapped", "control_noise", measures=swapped, summary=tables["summary"])
    hidden = section_control_noise.section(Results(tmp_path / "swapped"))
    assert "the noise hides 58 % of what the time step does" in hidden
    few = tables["measures"].query("actions == 9")
    write(tmp_path / "one", "control_noise", measures=few, summary=tables["summary"])
    with pytest.raises(Missing, match="one set of actions"):
        section_control_noise.section(Results(tmp_path / "one"))


def test_times_are_in_units_that_suit_them(tmp_path: Path) -> None:
    machine = {
        "cpu": "a cpu",
        "python": "3",
        "numpy": "2",
        "scipy": "1",
        "commit": "c",
        "date": "d",
    }
    times = pd.DataFrame(
        {
            "name": ["collate_point", "largest_paper_point"],
            "median_s": [0.0021, 12.34],
            "floor_s": [0.0005, np.nan],
            "ratio": [4.2, np.nan],
            "runs": 1,
            "what": ["collating", "all"],
            "paper": [np.nan, "5 min"],
        }
    ).assign(**machine)
    size = {"system": "t", "states": 1000, "actions": 15, "discretise_s": 0.5, "infer_s": 2e-5}
    costs = pd.DataFrame([{"name": "n", "what": "files", "value": 12.0, "unit": "inodes"}])
    scale = pd.DataFrame([{**size, "peak_mb": 150}])
    write(tmp_path, "benchmark", benchmark=times, costs=costs, scale=scale)
    found = Results(tmp_path)
    text = section_costs.section(found)
    assert "| collating |  | 2.1 ms | 500 µs | 4.2 |" in text
    assert "| all | 5 min | 12.3 s | - | - |" in text
    assert "| t | 1000 | 15 | 500 ms | 20 µs | 150 MB |" in text
    assert "| files | 12 inodes |" in text
    assert "| all | 12.3 s |" in text


def test_in_cell_sampling_counts_where_the_truth_is_found(results: Results) -> None:
    coarse = "cells == 100 and actions == 9"
    means, curve = measure_rows().query(coarse), curve_rows().query(coarse)
    better = curve.assign(samples=3, median=2.0, share_top_5_low=0.7)
    write(
        results.folder,
        "in_cell",
        measures=pd.concat([means, means.assign(samples=3)]),
        rank_curve=pd.concat([curve, better]),
    )
    text = section_start_points.section(Results(results.folder))
    assert "1 a dimension: 8 of 10; 3 a dimension: 10 of 10." in text
    assert "| C1, 0.2 s, 1 | 100 % [100, 100 %] |" in text


def test_what_is_not_there_is_told_with_its_command(results: Results) -> None:
    text = report(results)
    studies = ("telescope", "sensitivity", "calibration", "in_cell", "readings", "wrong_model")
    more = ("soft", "transfer", "control_limits", "next_task", "baselines", "areas", "dynamics")
    more += ("cells",)
    for study in (*studies, "rule_breaking", "control_noise", *more):
        assert f"`python experiments/run.py -m experiment={study}` makes it." in text
    assert "`make benchmark` makes it." in text
    there = ("## Where the numbers come from",)
    absent = ["## Claim 6", *(f"## {heading}" for heading, _, _ in SECTIONS)]
    for heading in absent:
        begins = f"{heading}\n\nNot there yet"
        assert (begins in text) == (heading not in there), heading
    few = results.table("paper", "measures").query("cells != 900")
    write(results.folder, "paper", measures=few)
    with pytest.raises(Missing, match=r"no point with truth c1, 900 cells and dt 0\.1 s"):
        claim_2.claim(Results(results.folder))
    write(results.folder, "paper", measures=few.drop(columns="low"))
    with pytest.raises(Missing, match=r"table `measures` of the study `paper` has no column low"):
        claim_2.claim(Results(results.folder))
    (results.folder / "paper" / "study.json").write_text("{")
    assert "## Where the numbers come from\n\nNot there yet" in report(Results(results.folder))


def test_the_report_says_where_it_comes_from(results: Results) -> None:
    text = report(results)
    # Of the lines b...b and a...a, as sha256sum prints it.
    assert "| paper | 2 | `efe6e6eaab79` |" in text
    assert "Machines: a machine." in text
    assert "Versions: numpy 0.1." in text
    assert "60 s" in text


class Links(HTMLParser):
    """What a page loads or links to."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.found += [value or "" for name, value in attrs if name in ("src", "href")]


def test_the_page_is_one_file_with_everything_in_it(tmp_path: Path) -> None:
    folder = tmp_path / "paper"
    folder.mkdir()
    (folder / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    text = (
        f"# Title\n\n{markdown.contents(['Claim 1: a, b & c'])}\n## Claim 1: a, b & c\n\n"
        f"| a | b |\n| --- | ---: |\n| x | 1 |\n\n"
        f"{markdown.figure('a.png', 3, 'A caption.')}\n<b>&\n"
    )
    parser = Links()
    content = page.html(text, folder)
    parser.feed(content)
    assert parser.found == ["#claim-1-a-b--c", "data:image/png;base64,iVBORw0KGgo="]
    assert '<h2 id="claim-1-a-b--c">' in content
    assert "<figcaption>Figure 3: A caption.</figcaption>\n</figure>" in content
    assert {"table", "h1", "img", "title"} <= set(parser.tags)
    assert "b" not in parser.tags
    assert "<title>Title</title>" in content


def test_the_command_writes_two_files_and_no_other(
    results: Results, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def files(folder: Path) -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}

    assert CHECKOUT is not None
    (results.folder / "results").symlink_to(results.folder)
    readme, before = CHECKOUT / "README.md", files(results.folder)
    text = readme.read_bytes()
    monkeypatch.chdir(results.folder)  # the default is `results` of the current folder
    monkeypatch.setattr("sys.argv", ["paper_figures.report"])
    assert command_line.main() == 0
    paths = [results.folder / "paper" / name for name in ("REPORT.md", "REPORT.html")]
    note = results.folder / "paper" / "report.json"
    assert paths[0].read_text() == report(results)
    assert capsys.readouterr().out == "".join(f"written: {path}\n" for path in paths)
    after = files(results.folder)
    assert set(after) - set(before) == {*paths, note}
    assert {path: after[path] for path in before} == before
    assert readme.read_bytes() == text
    monkeypatch.setattr("sys.argv", [*sys.argv, "--results", str(results.folder / "none")])
    with pytest.raises(SystemExit, match=r"no study in .*none: run one first"):
        command_line.main()


def test_words_of_files_are_no_markup() -> None:
    """Neither HTML, nor a picture that is fetched, nor a line or column of their own."""
    evil = "<script>x</script>\n|![y](http://z)"
    text = markdown.without_markup(markdown.table(["truth", "n"], [[evil, 1]]))
    assert text.splitlines()[2:] == [r"| &lt;script>x&lt;/script> \|!\[y](http://z) | 1 |"]
    for path in ("figures/a_b.png", "../telescope/figures/a.png"):
        whole = markdown.figure(path, 3, "p < 0.01")
        assert markdown.without_markup(whole) == whole
    assert "!\\[Figure 1]" in markdown.without_markup("![Figure 1](http://z/figures/a.png)")


def test_a_forged_listing_is_damage(tmp_path: Path) -> None:
    point = "0" * 32
    of_nobody = {"sources": {}, "systems": (), "made_by": "", "versions": (), "tables": {}}
    for commits, damage in (("c0ffee",), 0), ((3,), 1):
        collated = Collated(points=(point,), commits=commits, dirty=False, **of_nobody)
        Study(tmp_path / "s", {point: ()}, {}, collated).save()
        results = Results(tmp_path)
        with nullcontext() if damage == 0 else pytest.raises(Missing):
            assert results.listing("s")["commits"] == list(commits)
        assert len(results.damage) == damage
