"""What a folder of results holds: studies, and points by their identities."""

from __future__ import annotations

import csv
import operator
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from experiments.config.suggestions import did_you_mean
from experiments.tracking.points import Point, State
from experiments.tracking.study import Study, StudyError, read_study
from experiments.tracking.trees import flatten


class ArchiveError(Exception):
    """Something that was asked for and is not there; the message says what is."""


@dataclass(frozen=True)
class KeptPoint:
    """What a person asks about a point, each looked up once.

    Attributes:
        point: the point.
    """

    point: Point

    @property
    def identity(self) -> str:
        return self.point.identity

    @cached_property
    def content(self) -> dict[str, Any]:
        """Its record, or nothing unless it finished and is as it was written."""
        return self.point.record() or {}

    @cached_property
    def known_state(self) -> State:
        """Its state when it was first asked for."""
        return self.point.state()

    @cached_property
    def config(self) -> dict[str, Any]:
        """Its config by dotted keys, as far as it is known."""
        return flatten(self.content.get("config", {}))

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The row of its summary table, opened by its columns; nothing unless it finished."""
        if "summary.csv" not in self.content.get("files", {}):
            return {}
        with (self.point.folder / "summary.csv").open(newline="") as file:
            row = next(csv.DictReader(file), {})
        return {key: _value(text) for key, text in row.items()}


@dataclass(frozen=True)
class Archive:
    """A folder of results.

    Attributes:
        results: the folder.
    """

    results: Path

    @cached_property
    def _listings(self) -> dict[str, Study | StudyError]:
        """Every study by its name, or why it cannot be read."""
        found: dict[str, Study | StudyError] = {}
        for path in sorted(self.results.glob("*/study.json")):
            try:
                study = read_study(path.parent)
            except StudyError as error:
                found[path.parent.name] = error
            else:
                if study is not None:
                    found[path.parent.name] = study
        return found

    @property
    def studies(self) -> dict[str, Study]:
        """Every study that can be read, by its name."""
        return {name: it for name, it in self._listings.items() if isinstance(it, Study)}

    @property
    def unreadable(self) -> list[str]:
        """Why the other studies cannot be read."""
        return [str(it) for it in self._listings.values() if isinstance(it, StudyError)]

    @cached_property
    def points(self) -> dict[str, KeptPoint]:
        """Every point with a folder, by its identity."""
        folders = sorted(self.results.glob("points/*/"))
        return {folder.name: KeptPoint(Point(self.results, folder.name)) for folder in folders}

    def points_of(self, study: Study) -> list[KeptPoint]:
        """The points of a study, in the order of its plan."""
        return [
            self.points.get(name) or KeptPoint(Point(self.results, name)) for name in study.points
        ]

    def find(self, name: str) -> Study | KeptPoint:
        """A study by its name, or a point by its identity or the beginning of it.

        Raises:
            ArchiveError: there is none, or several.
        """
        found = self._listings.get(name)
        if isinstance(found, StudyError):
            raise ArchiveError(str(found))
        if found is not None:
            return found
        planned = {point for study in self.studies.values() for point in study.points}
        if re.fullmatch("[0-9a-f]+", name):
            matches = sorted(key for key in planned.union(self.points) if key.startswith(name))
            if len(matches) == 1:
                return self.points.get(matches[0]) or KeptPoint(Point(self.results, matches[0]))
            if matches:
                some = ", ".join(match[: len(name) + 8] for match in matches[:5])
                raise ArchiveError(f"{name}: {len(matches)} points begin so, such as {some}")
        if not self._listings and not self.points:
            raise ArchiveError(
                f"{self.results} holds no results; run a sweep first, or give --results"
            )
        raise ArchiveError(f"{name}: no such study or point{did_you_mean(name, self._listings)}")

    def study(self, name: str) -> Study:
        """A study by its name.

        Raises:
            ArchiveError: there is none.
        """
        found = self._listings.get(name) or self.find(name)
        if not isinstance(found, Study):
            raise ArchiveError(f"{name}: no such study{did_you_mean(name, self._listings)}")
        return found


def count_states(points: Iterable[KeptPoint]) -> Counter[State]:
    """How many points are in each state."""
    return Counter(point.known_state for point in points)


def varying(points: Sequence[KeptPoint]) -> list[str]:
    """Dotted keys of the config that differ between points whose config is known."""
    known = [point.config for point in points if point.config]
    keys = dict.fromkeys(key for config in known for key in config)
    return [key for key in keys if len({str(config.get(key)) for config in known}) > 1]


_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "=": operator.eq,
}


def select(points: Iterable[KeptPoint], conditions: Sequence[str]) -> list[KeptPoint]:
    """The points that meet all conditions on their config or their summary.

    Args:
        points: the points.
        conditions: such as "truth=c1", "dt<=0.25" or "grid.shape=[20,20]"; = takes several values,
            "actions=5,9".

    Raises:
        ArchiveError: a condition that cannot be read, or a key that no point has.
    """
    parsed = []
    for condition in conditions:
        if not (parts := re.fullmatch(r"([\w.]+)\s*(<=|>=|!=|==?|<|>)\s*(.+)", condition)):
            raise ArchiveError(f"{condition}: cannot be read as key=value; try dt<=0.25, in quotes")
        key, sign, text = parts[1], parts[2].replace("==", "="), parts[3]
        texts = [text] if text.startswith("[") else text.split(",")
        parsed.append((key, sign, [_value(part) for part in texts]))
    kept, seen = [], set[str]()
    for point in points:
        facts = {**point.config, **point.summary}
        seen.update(facts)
        if all(key in facts and _meets(facts[key], sign, values) for key, sign, values in parsed):
            kept.append(point)
    for key, _, _ in parsed:
        if seen and key not in seen:
            raise ArchiveError(f"{key}: no point has this key{did_you_mean(key, seen)}")
    return kept


def _meets(fact: Any, sign: str, values: Sequence[Any]) -> bool:
    """Whether a fact compares as wanted with one of the values, or, for !=, with all."""
    fact = _value(fact) if isinstance(fact, str) else fact
    try:
        each = [_COMPARE[sign](fact, value) for value in values]
    except TypeError:
        return False
    return all(each) if sign == "!=" else any(each)


def _value(text: str) -> Any:
    """A value as YAML spells it; a word otherwise."""
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            pass
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return text
