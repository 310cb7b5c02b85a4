"""Every figure of tables that were made up, drawn once for all tests."""

from collections.abc import Callable
from functools import cache
from types import ModuleType

import matplotlib.pyplot as plt
import pandas as pd
import pytest
from choice_studies import choice_tables
from figure_study import growth_rows, scale_rows, study_tables
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


@cache
def all_tables() -> dict[str, dict[str, pd.DataFrame]]:
    """Tables by figure, where they are those of another study than the paper's."""
    sizes = {"scale": scale_rows(), "growth": growth_rows()}
    return {**choice_tables(), "time_and_memory": sizes, "": study_tables()}


def tables_for(module: ModuleType) -> dict[str, pd.DataFrame]:
    """Copies of the tables that one figure is drawn from: of the first truth, if each has one."""
    studies = all_tables()
    study = studies.get(module.__name__.rpartition(".")[2], studies[""])
    tables = {name: study[name].copy() for name in module.TABLES}
    if not hasattr(module, "EACH"):
        return tables
    return {
        name: table[table["truth"] == "c1"].reset_index(drop=True) for name, table in tables.items()
    }


@pytest.fixture(scope="session", name="tables_for")
def _tables_for() -> Callable[[ModuleType], dict[str, pd.DataFrame]]:
    """The made-up tables that a figure needs; a test may change them."""
    return tables_for


@pytest.fixture(scope="session")
def drawn() -> Callable[[ModuleType], Figure]:
    """A figure of its made-up tables, drawn once; a test only looks at it."""

    @cache
    def draw(module: ModuleType) -> Figure:
        figure: Figure = module.draw(**tables_for(module))
        plt.close(figure)
        FigureCanvasAgg(figure)  # which closing took away
        return figure

    return draw
