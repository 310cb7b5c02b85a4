"""What is compared with other ways to rank regions."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, CountOrNone, about


@dataclass(frozen=True, config=STRICT)
class BaselineSettings:
    """Other ways to rank regions, compared on the same demonstrations."""

    paths: Annotated[
        CountOrNone,
        about("sampled unconstrained paths of each task, for baselines; 0 compares none"),
    ]
