"""Where configs and results are: in the checkout, or beside the code of an installed wheel."""

from __future__ import annotations

from pathlib import Path

_CODE = Path(__file__).resolve().parent

CHECKOUT = _CODE.parent if (_CODE.parent / "conf" / "config.yaml").is_file() else None
CONF = _CODE / "conf" if CHECKOUT is None else CHECKOUT / "conf"


def is_inside_checkout() -> bool:
    """Whether the current folder is the checkout or lies in it."""
    return CHECKOUT is not None and Path.cwd().is_relative_to(CHECKOUT)


def default_results() -> Path:
    """`results` of the checkout, or of the current folder where that lies outside of it."""
    home = CHECKOUT if CHECKOUT is not None and is_inside_checkout() else Path.cwd()
    return home / "results"
