"""Points by conditions on what is known of them: `dt<=0.25`, `truth=c1`, `actions=9,15`."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from experiments.config.suggestions import did_you_mean
from experiments.lookback.archive import ArchiveError, Facts, value_of

_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "=": operator.eq,
    "==": operator.eq,
}


@dataclass(frozen=True)
class Condition:
    """A comparison of one fact of a point.

    Attributes:
        key: a dotted key of the config, or a column of the summary.
        sign: how it is compared.
        values: with one of which it must compare so; for != with all.
    """

    key: str
    sign: str
    values: tuple[Any, ...]

    @classmethod
    def read(cls, text: str) -> Condition:
        """A condition as people type it.

        Raises:
            ArchiveError: it cannot be read.
        """
        parts = re.fullmatch(r"([\w.]+)\s*(<=|>=|!=|==?|<|>)\s*(.+)", text)
        if not parts:
            raise ArchiveError(f"{text}: cannot be read as key=value; try dt<=0.25, in quotes")
        key, sign, values = parts.groups()
        texts = [values] if values.startswith("[") else values.split(",")
        return cls(key, sign, tuple(map(value_of, texts)))

    def holds(self, fact: Any) -> bool:
        """Whether a value of the key meets the condition."""
        fact = value_of(fact) if isinstance(fact, str) else fact
        try:
            results = [_COMPARE[self.sign](fact, value) for value in self.values]
        except TypeError:
            return False
        return all(results) if self.sign == "!=" else any(results)


def select(points: Iterable[Facts], conditions: Sequence[str]) -> list[Facts]:
    """The points that meet all conditions on their config or their summary.

    Args:
        points: the points.
        conditions: such as "truth=c1", "dt<=0.25" or "grid.shape=[20,20]"; = takes several values,
            "actions=5,9".

    Raises:
        ArchiveError: a condition that cannot be read, or a key that no point has.
    """
    parsed = [Condition.read(text) for text in conditions]
    matches, keys = [], set[str]()
    for point in points:
        facts = {**point.config, **point.summary}
        keys.update(facts)
        if all(it.key in facts and it.holds(facts[it.key]) for it in parsed):
            matches.append(point)
    for it in parsed:
        if keys and it.key not in keys:
            raise ArchiveError(f"{it.key}: no point has this key{did_you_mean(it.key, keys)}")
    return matches


def varying(points: Sequence[Facts]) -> list[str]:
    """Dotted keys of the config that differ between points whose config is known."""
    configs = [point.config for point in points if point.config]
    keys = dict.fromkeys(key for config in configs for key in config)
    return [key for key in keys if len({str(config.get(key)) for config in configs}) > 1]
