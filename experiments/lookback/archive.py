"""What a folder of results holds: studies, and points by their identities."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable
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
class Facts:
    """What people ask about a point; each file is read once.

    Attributes:
        point: the point.
    """

    point: Point

    @cached_property
    def record(self) -> dict[str, Any]:
        """Its record; empty unless it finished and its files are as they were written."""
        return self.point.record() or {}

    @cached_property
    def state(self) -> State:
        """Its state when it was first asked for."""
        return self.point.state()

    @cached_property
    def config(self) -> dict[str, Any]:
        """Its config by dotted keys, as far as it is known."""
        return flatten(self.record.get("config", {}))

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The row of its summary table, opened by its columns; empty unless it finished."""
        if "summary.csv" not in self.record.get("files", {}):
            return {}
        with (self.point.folder / "summary.csv").open(newline="") as file:
            row = next(csv.DictReader(file), {})
        return {key: value_of(text) for key, text in row.items()}


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
        listings: dict[str, Study | StudyError] = {}
        for path in sorted(self.results.glob("*/study.json")):
            try:
                study = read_study(path.parent)
            except StudyError as error:
                listings[path.parent.name] = error
            else:
                if study is not None:
                    listings[path.parent.name] = study
        return listings

    @property
    def studies(self) -> dict[str, Study]:
        """Every study that can be read, by its name."""
        return {name: it for name, it in self._listings.items() if isinstance(it, Study)}

    @property
    def unreadable(self) -> list[str]:
        """Why the other studies cannot be read."""
        return [str(it) for it in self._listings.values() if isinstance(it, StudyError)]

    @cached_property
    def points(self) -> dict[str, Facts]:
        """Every point with a folder, by its identity."""
        folders = sorted(self.results.glob("points/*/"))
        return {folder.name: Facts(Point(self.results, folder.name)) for folder in folders}

    def point(self, identity: str) -> Facts:
        """A point by its identity, whether it has a folder or not."""
        return self.points.get(identity) or Facts(Point(self.results, identity))

    def points_of(self, study: Study) -> list[Facts]:
        """The points of a study, in the order of its plan."""
        return [self.point(identity) for identity in study.points]

    def find(self, name: str) -> Study | Facts:
        """A study by its name, or a point by its identity or the beginning of it.

        Raises:
            ArchiveError: there is none, or several.
        """
        listing = self._listings.get(name)
        if isinstance(listing, StudyError):
            raise ArchiveError(str(listing))
        if listing is not None:
            return listing
        planned = {point for study in self.studies.values() for point in study.points}
        if re.fullmatch("[0-9a-f]+", name):
            matches = sorted(key for key in planned.union(self.points) if key.startswith(name))
            if len(matches) == 1:
                return self.point(matches[0])
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
        study = self._listings.get(name) or self.find(name)
        if not isinstance(study, Study):
            raise ArchiveError(f"{name}: no such study{did_you_mean(name, self._listings)}")
        return study


def count_states(points: Iterable[Facts]) -> Counter[State]:
    """How many points are in each state."""
    return Counter(point.state for point in points)


def value_of(text: str) -> Any:
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
