"""Draw the figures of a study from its tables: python -m paper_figures [STUDY] (default: paper)."""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from paper_figures import hypothesis_map, rank_curve
from paper_figures.origin import table_digest, write_note
from paper_figures.style import save

# What single figures show, where a study holds it; the nearest that it holds otherwise.
CELLS, ACTIONS, DT = 400, 9, 0.25

_MAP_TABLES = ("hypotheses", "paths", "dimensions")
_CURVE_TABLES = ("rank_quantiles",)


def main() -> int:
    """Run the command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="paper_figures", description=__doc__)
    parser.add_argument("study", nargs="?", default="paper", metavar="STUDY")
    parser.add_argument("--results", type=Path, help="folder of results", metavar="DIR")
    chosen = parser.parse_args()
    for path in draw_study((chosen.results or _default_results()) / chosen.study):
        print(f"drawn: {path}")
    return 0


def draw_study(study: Path) -> list[Path]:
    """Draw every figure of a study into its folder `figures`; returns their paths.

    Raises:
        SystemExit: a table is missing.
    """
    needed = sorted({*_MAP_TABLES, *_CURVE_TABLES})
    paths = {name: study / "tables" / f"{name}.csv" for name in needed}
    missing = [name for name, path in paths.items() if not path.is_file()]
    if missing:
        raise SystemExit(
            f"{study / 'tables'} has no table {', '.join(missing)}: run the study first, "
            f"python experiments/run.py -m experiment={study.name}"
        )
    contents = {name: path.read_bytes() for name, path in paths.items()}
    tables = {name: pd.read_csv(io.BytesIO(data)) for name, data in contents.items()}
    drawn, origins = [], {}
    for name, figure, used in _figures(tables):
        drawn.append(save(figure, study / "figures" / name))
        origins[name] = {f"{table}.csv": table_digest(contents[table]) for table in used}
    write_note(study, origins)
    return drawn


def _figures(tables: dict[str, pd.DataFrame]) -> Iterator[tuple[str, Figure, tuple[str, ...]]]:
    """Each figure with its name and the tables that it shows."""
    chosen = _nearest(
        _nearest(_nearest(tables["hypotheses"], "cells", CELLS), "dt", DT), "actions", ACTIONS
    )
    for truth, hypotheses in chosen.groupby("truth", sort=True):
        settings = hypotheses.iloc[0]
        figure = hypothesis_map.draw(
            hypotheses,
            tables["paths"][tables["paths"]["truth"] == truth],
            tables["dimensions"][tables["dimensions"]["truth"] == truth],
            f"truth {truth.upper()}, {settings['cells']} cells, {settings['actions']} "
            f"actions, $\\Delta t$ = {settings['dt']:g} s",
        )
        yield f"hypotheses_{truth}", figure, _MAP_TABLES
    quantiles = _nearest(tables["rank_quantiles"], "actions", ACTIONS)
    yield "rank_of_the_truth", rank_curve.draw(quantiles), _CURVE_TABLES


def _nearest(table: pd.DataFrame, column: str, value: float) -> pd.DataFrame:
    """The rows whose `column` is nearest to a value."""
    return table[(table[column] - value).abs() == (table[column] - value).abs().min()]


def _default_results() -> Path:
    """The checkout's results, or those of the current folder where there is no checkout."""
    root = Path(__file__).resolve().parents[1]
    return (root if (root / "conf" / "config.yaml").is_file() else Path.cwd()) / "results"


if __name__ == "__main__":
    sys.exit(main())
