"""The one rule for where configs and results are; light, so that anything may import it.

Configs lie in the checkout, or beside the code of an installed wheel; results in the checkout if
that is where one works, else in the current folder.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from experiments.tracking import environment

_CODE = Path(__file__).resolve().parents[1]

CHECKOUT = environment.CHECKOUT
CONF = _CODE / "conf" if CHECKOUT is None else CHECKOUT / "conf"


class HasResults(Protocol):
    """Settings that may name a folder of results."""

    @property
    def results(self) -> str | None:
        """The folder's name; None for the usual one."""


def is_inside_checkout() -> bool:
    """Whether the current folder is the checkout or lies in it."""
    return CHECKOUT is not None and Path.cwd().is_relative_to(CHECKOUT)


def default_results() -> Path:
    """`results` of the checkout, or of the current folder where that lies outside of it."""
    home = CHECKOUT if CHECKOUT is not None and is_inside_checkout() else Path.cwd()
    return home / "results"


def results_folder(settings: HasResults) -> Path:
    """Where results go: the usual folder unless the settings name another; `~` is one's home."""
    if settings.results is None:
        return default_results()
    return Path(settings.results).expanduser().resolve()
