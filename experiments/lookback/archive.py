"""What a folder of results holds: studies, and points by their identities."""

from __future__ import annotations

import csv
import io
import os
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from experiments.config.suggestions import did_you_mean
from experiments.tracking import report_note
from experiments.tracking.files import read_file
from experiments.tracking.forms import is_deep, record_fault, study_fault
from experiments.tracking.names import is_identity
from experiments.tracking.own_modules import on_path
from experiments.tracking.points import Point, State, system_module
from experiments.tracking.study import Study, StudyError, read_study
from experiments.tracking.study_tables import table_changes
from experiments.tracking.trees import flatten

# What a report leaves, also where the study `paper` has not run; it uses no point.
_REPORT = {"REPORT.md", "REPORT.html", report_note.NOTE}
KINDS = ("points", "store", "diffs", "inference", "trash")  # folders of results but studies


class ArchiveError(Exception):
    """Something that was asked for and is not there; the message says what is."""


def reason(error: OSError) -> str:
    """What the system says, and of which file where it tells."""
    words = error.strerror or str(error)
    return words if error.filename is None else f"{error.filename}: {words}"


@dataclass(frozen=True)
class Facts:
    """What people ask about a point; each file is read once.

    Attributes:
        point: the point.
        is_shipped: whether its values are in a study's tables, which came without its folder.
    """

    point: Point
    is_shipped: bool = False

    @cached_property
    def record(self) -> dict[str, Any]:
        """Its record; empty unless it finished, and record and files are as points write them."""
        return {} if self._fault else self._record

    @cached_property
    def state(self) -> State:
        """Its state when it was first asked for; missing if it cannot be read."""
        if self.is_shipped:
            return State.SHIPPED
        if self._fault:
            return State.MISSING
        try:
            with on_path(system_module(self.record.get("config", {}))):  # to read its source
                return self.point.state()
        except OSError:
            return State.MISSING

    @cached_property
    def damage(self) -> str | None:
        """Why its record does not count, although there is one."""
        if self.is_shipped:
            return None
        if self._fault:
            return f"{self.point.folder / 'record.json'} is no record of a point: {self._fault}"
        try:
            damage = self.point.damage()
            if damage is None and self.state is State.MISSING:
                self.point.is_running()  # perhaps nobody can tell, as its lock is a folder
        except OSError as error:
            return reason(error)
        return damage

    @cached_property
    def failure(self) -> dict[str, Any] | None:
        """How its last attempt failed; None if it did not, or left nothing that can be read."""
        try:
            failure = self.point.failure()
        except (OSError, RecursionError):
            return None
        return None if is_deep(failure) else failure

    @cached_property
    def _record(self) -> dict[str, Any]:
        """Its record if it is whole, whatever it holds."""
        return self.point.record() or {}

    @cached_property
    def _fault(self) -> str | None:
        """What keeps a whole record from being one that a point wrote; None if nothing does."""
        try:
            return record_fault(self._record) if self._record else None
        except RecursionError:
            return "it nests too deep"

    @cached_property
    def config(self) -> dict[str, Any]:
        """Its config by dotted keys, as far as it is known."""
        return flatten(self.record.get("config", {}))

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The row of its summary table, opened by its columns; empty unless it finished."""
        if "summary.csv" not in self.record.get("files", {}):
            return {}
        try:
            text = read_file(self.point.folder / "summary.csv").decode()
            row: dict[Any, Any] = next(csv.DictReader(io.StringIO(text)), {})
        except (OSError, ValueError, csv.Error):
            return {}
        return {key: value_of(text) for key, text in row.items() if key and text is not None}


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
        for folder in self._folders:
            try:
                if (study := read_study(folder)) is None:
                    continue
                if fault := study_fault(study):
                    raise StudyError(f"{folder / 'study.json'} is no listing of a study: {fault}")
                listings[folder.name] = study
            except StudyError as error:
                listings[folder.name] = error
        return listings

    @property
    def studies(self) -> dict[str, Study]:
        """Every study that can be read, by its name."""
        return {name: it for name, it in self._listings.items() if isinstance(it, Study)}

    @property
    def unreadable(self) -> list[str]:
        """What cannot be read, and why: studies, points, folders."""
        studies = [str(it) for it in self._listings.values() if isinstance(it, StudyError)]
        return [*studies, *self._inside[1], *self._points_inside[1]]

    @property
    def without_listing(self) -> list[Path]:
        """Folders of results that hold something and are neither studies nor known otherwise."""
        others = [folder for folder in self._folders if folder.name not in self._listings]
        return [folder for folder in others if not _is_known(folder)]

    @property
    def _folders(self) -> list[Path]:
        return self._inside[0]

    @cached_property
    def _inside(self) -> tuple[list[Path], list[str]]:
        """The folders in that of results, and what cannot be read there."""
        return _inner_folders(self.results)

    @cached_property
    def _points_inside(self) -> tuple[list[Path], list[str]]:
        """The folders of points, and what is none."""
        if not any(folder.name == "points" for folder in self._folders):
            return [], []
        folders, problems = _inner_folders(self.results / "points")
        strange = [f"{it}: is no point" for it in folders if not is_identity(it.name)]
        others = [it for it in (self.results / "points").glob("[!.]*") if not it.is_dir()]
        strange += [f"{it}: is no folder, and no point" for it in others if not it.is_symlink()]
        return [it for it in folders if is_identity(it.name)], problems + strange

    @cached_property
    def points(self) -> dict[str, Facts]:
        """Every point with a folder, by its identity."""
        folders = self._points_inside[0]
        return {folder.name: Facts(Point(self.results, folder.name)) for folder in folders}

    @cached_property
    def _shipped(self) -> frozenset[str]:
        """Points that studies have tables of, as they were written, and no folder."""
        points: set[str] = set()
        for study in self.studies.values():
            if study.collated and not points.issuperset(study.collated.points):
                changes = table_changes(study)
                is_there = len(changes.missing) < len(study.collated.tables)
                if is_there and not changes.damaged:
                    points.update(study.collated.points)
        return frozenset(points.difference(self.points))

    def point(self, identity: str) -> Facts:
        """A point by its identity, whether it has a folder or not."""
        known = self.points.get(identity)
        return known or Facts(Point(self.results, identity), identity in self._shipped)

    def points_of(self, study: Study) -> list[Facts]:
        """The points of a study, in the order of its plan."""
        return [self.point(identity) for identity in study.points]

    def find(self, name: str) -> Study | Facts:
        """A study by its name, or a point by its identity, the beginning of it, or its folder.

        Raises:
            ArchiveError: there is none, or several.
        """
        if (path := Path(name).resolve()).parent == (self.results / "points").resolve():
            name = path.name  # as `run.py` prints it
        if isinstance(listing := self._listings.get(name), StudyError):
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
        raise ArchiveError(f"{name}: no such study or point{self._known(name)}")

    def study(self, name: str) -> Study:
        """A study by its name.

        Raises:
            ArchiveError: there is none.
        """
        study = self._listings.get(name) or self.find(name)
        if not isinstance(study, Study):
            raise ArchiveError(f"{name}: no such study{self._known(name)}")
        return study

    def _known(self, name: str) -> str:
        """The end of a message about an unknown name."""
        nothing = f" in {self.results}, which holds no study"
        return did_you_mean(name, self._listings) if self._listings else nothing


def _inner_folders(folder: Path) -> tuple[list[Path], list[str]]:
    """The folders in a folder, by name, and what cannot be read there; links are not followed."""
    folders, problems = [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.is_symlink():
                    problems.append(f"{entry.path}: is a link, which is not followed")
                elif entry.is_dir() and not entry.name.startswith("."):
                    folders.append(Path(entry.path))
    except FileNotFoundError:
        return [], []
    except OSError as error:
        problems.append(f"{folder}: {error.strerror}")
    return sorted(folders), sorted(problems)


def _is_known(folder: Path) -> bool:
    """Whether a folder of results that is no study uses no point: of a known kind, or a report."""
    if folder.name in KINDS or (folder / "points").is_dir():  # results in results
        return True
    return {path.name for path in folder.iterdir()} <= _REPORT


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
    except (yaml.YAMLError, ValueError, TypeError, AttributeError, RecursionError):
        return text  # such as a date that no calendar has
