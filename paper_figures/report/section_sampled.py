"""Whether sampled paths say the same as cells, and how surely."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Results
from paper_figures.sampled_models import TABLES, change_rows, name, slopes

STUDY = "sampled"
_AFTER = 9  # demonstrations after which the paper looks at the rank


def section(results: Results) -> str:
    """Ranks, forecasts and convergence, a line a model.

    Raises:
        Missing: the study `sampled` is not there yet.
    """
    models, halving, curve = (results.table(STUDY, each, TABLES[each]) for each in TABLES)
    ranks = curve[curve["demonstrations"] == min(_AFTER, curve["demonstrations"].max())]
    lines = [
        [row["truth"].upper(), name(row["cells"]), _limits(row, "median"), _shares(row)]
        for row in ranks.to_dict("records")
    ]
    scores = [
        [
            name(cells),
            *(
                between(*(f"{row[score + end]:.4f}" for end in ("", "_low", "_high")))
                for score in ("brier", "log_score")
            ),
            f"{row['off_by']:.4f}",
        ]
        for cells, row in ((c, group.iloc[0]) for c, group in models.groupby("cells"))
    ]
    after = int(ranks["demonstrations"].max())
    return (
        "Cells are not needed where the reward is the squared control: paths are drawn round the "
        "locally optimal ways and weighed, and every probability comes with a standard error.\n\n"
        f"{_settled(models)}{_slopes(halving)}\n"
        f"Rank of the truth after {after} demonstrations, and share of subsets with it in the top "
        "5:\n\n"
        + table(["truth", "model", "median rank", "top 5"], lines, words=2)
        + "\nForecasts of which regions demonstrators enter whom nothing constrains, on the same "
        "tasks; a small Brier score and a large log score [nat] are good:\n\n"
        + table(["model", "Brier score", "log score", "off by"], scores, words=1)
        + "\nRoot mean square change of Phi from a time step to the next shorter one, less the "
        "noise of samples:\n\n" + _changes(halving)
    )


def _limits(row: dict[str, float], column: str) -> str:
    """A value with its interval."""
    return between(*(number(row[column + end]) for end in ("", "_low", "_high")))


def _shares(row: dict[str, float]) -> str:
    """How often the truth is among the first five."""
    return between(*(percent(row["share_top_5" + end]) for end in ("", "_low", "_high")))


def _settled(models: pd.DataFrame) -> str:
    """How surely sampled ranks are known."""
    sampled = models[models["cells"] == 0]
    lines = [
        f"- {row.truth.upper()}, seed {row.seed}: with all demonstrations {row.settled} of the "
        f"first ranks are settled at 95 %; the truth is at rank {row.rank:g}, and samples leave it "
        f"between {row.rank_lowest:g} and {row.rank_highest:g}; the samples of {row.doubted:g} "
        "tasks are not to be believed.\n"
        for row in sampled.itertuples()
    ]
    return "".join(lines)


def _slopes(halving: pd.DataFrame) -> str:
    """How Phi converges."""
    return "".join(
        f"- {name(row['cells'])}: the change of Phi goes with dt to the power of "
        f"{between(*(number(row[key]) for key in ('slope', 'low', 'high')))}.\n"
        for row in slopes(halving).to_dict("records")
    )


def _changes(halving: pd.DataFrame) -> str:
    """A line a model, a column a time step."""
    rows = change_rows(halving)
    steps = sorted(rows["step"].unique(), reverse=True)
    lines = []
    for cells, some in rows.groupby("cells"):
        by_step = some.set_index("step")
        values = [
            between(*(number(by_step.loc[step, key]) for key in ("rms", "low", "high")))
            for step in steps
        ]
        lines.append([name(int(cells)), *values])
    return table(["model", *(f"from {step:g} s" for step in steps)], lines, words=1)
