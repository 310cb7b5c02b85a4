"""Where configs and results are: in the checkout, or beside the code of an installed wheel."""

from __future__ import annotations

from pathlib import Path

_CODE = Path(__file__).resolve().parent

CHECKOUT = _CODE.parent if (_CODE.parent / "conf" / "config.yaml").is_file() else None
CONF = _CODE / "conf" if CHECKOUT is None else CHECKOUT / "conf"


def default_results() -> Path:
    """The checkout's results, or those of the current folder where there is no checkout."""
    return (CHECKOUT or Path.cwd()) / "results"
