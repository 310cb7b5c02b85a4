"""Draw the figures of a study from its tables: python -m paper_figures [STUDY] (default: paper)."""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from paper_figures import hypothesis_map, rank_curve
from paper_figures.style import save

RESULTS = Path(__file__).resolve().parents[1] / "results"
# What single figures show, where a study holds it; the nearest that it holds otherwise.
CELLS, ACTIONS, DT = 400, 9, 0.25


def main(study: Path) -> list[Path]:
    """Draw every figure of a study into its folder `figures`; returns their paths."""
    tables = {path.stem: pd.read_csv(path) for path in sorted((study / "tables").glob("*.csv"))}
    missing = {"dimensions", "hypotheses", "paths", "rank_quantiles"} - set(tables)
    if missing:
        raise SystemExit(
            f"{study / 'tables'} has no table {', '.join(sorted(missing))}: run the study first, "
            f"python experiments/run.py -m experiment={study.name}"
        )
    figures = study / "figures"
    drawn = []
    chosen = _nearest(
        _nearest(_nearest(tables["hypotheses"], "cells", CELLS), "dt", DT), "actions", ACTIONS
    )
    for truth, hypotheses in chosen.groupby("truth", sort=True):
        settings = hypotheses.iloc[0]
        drawn.append(
            save(
                hypothesis_map.draw(
                    hypotheses,
                    tables["paths"][tables["paths"]["truth"] == truth],
                    tables["dimensions"][tables["dimensions"]["truth"] == truth],
                    f"truth {truth.upper()}, {settings['cells']} cells, {settings['actions']} "
                    f"actions, $\\Delta t$ = {settings['dt']:g} s",
                ),
                figures / f"hypotheses_{truth}",
            )
        )
    quantiles = _nearest(tables["rank_quantiles"], "actions", ACTIONS)
    drawn.append(save(rank_curve.draw(quantiles), figures / "rank_of_the_truth"))
    return drawn


def _nearest(table: pd.DataFrame, column: str, value: float) -> pd.DataFrame:
    """The rows whose `column` is nearest to a value."""
    return table[(table[column] - value).abs() == (table[column] - value).abs().min()]


if __name__ == "__main__":
    for path in main(RESULTS / (sys.argv[1] if len(sys.argv) > 1 else "paper")):
        print(f"drawn: {path}")
