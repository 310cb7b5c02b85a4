"""Where configs and results are: in the checkout, or beside the code of an installed wheel."""

from __future__ import annotations

from pathlib import Path

from experiments.config.settings import RecordedSettings, StudySettings
from experiments.tracking import environment

_CODE = Path(__file__).resolve().parents[1]

CHECKOUT = environment.CHECKOUT
CONF = _CODE / "conf" if CHECKOUT is None else CHECKOUT / "conf"


def is_inside_checkout() -> bool:
    """Whether the current folder is the checkout or lies in it."""
    return CHECKOUT is not None and Path.cwd().is_relative_to(CHECKOUT)


def default_results() -> Path:
    """`results` of the checkout, or of the current folder where that lies outside of it."""
    home = CHECKOUT if CHECKOUT is not None and is_inside_checkout() else Path.cwd()
    return home / "results"


def results_folder(settings: StudySettings | RecordedSettings) -> Path:
    """Where results go: the usual folder unless another is given."""
    given = settings.results
    return default_results() if given is None else Path(given).resolve()
