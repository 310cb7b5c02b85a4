"""A study on disk: `study.json` lists its points and, once collated, what its tables came from.

{"points": {identity: [override, ...], ...},     as planned when the sweep started
 "examples": {name: ..., ...},                 what the study's file says under `examples`
 "collated": null or {
   "points": [identity, ...],                    in the order of the tables' rows
   "sources": {hash of the source: points, ...},
   "systems": [module, ...], "made_by": hash of the source that made the tables,
   "commits": [git commit, ...], "dirty": whether any had changes,
   "versions": [package and version, ...],
   "tables": {file: sha256, ...},
   "kept": [file, ...]}}                         tables that agree with the new ones, and stayed

What differs each time that the same is computed stands in `runs.json` beside it:

{"made_of": hash of the points' records, the plan's cases and its examples,
 "attempts": [of each point, in that order],
 "started": [first, last], "seconds": of all points, "peak_memory_mb": the most of one,
 "machines": [name, ...]}
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.tracking.names import inner_path, is_digest, is_identity, is_name
from experiments.tracking.points import Point, system_module
from experiments.tracking.sealed import SealError, read_sealed, write_sealed
from experiments.tracking.sources import source_hash
from experiments.tracking.trees import plain

RUNS = "runs.json"
_OF_RUNS = ("made_of", "attempts", "started", "seconds", "peak_memory_mb", "machines")
_COLLATES = "experiments.collate.join"  # named, so that its source counts, and not imported


class StudyError(Exception):
    """A listing that cannot be read; the message names it."""


@dataclass(frozen=True)
class Collated:
    """What the tables of a study came from.

    Attributes:
        points: identities, in the order of the tables' rows.
        sources: how many points come from each version of the source, by its hash.
        systems: the modules of the points' systems, which tell what the source is now.
        made_by: hash of the source that made the tables of those of the points.
        commits: the git commits that were checked out, where they are known.
        dirty: whether anything differed from them.
        started: when the first and the last point were started, as ISO 8601.
        seconds: that all points took, one after the other; what points share counts once.
        peak_memory_mb: the most that the process of one point needed.
        machines: processor, cores and system of each machine that ran points.
        versions: of Python and the packages that results depend on, spelt "numpy 2.4.6".
        tables: sha256 of each table, by its file's name.
        kept: those that were there before and agree with the new ones, which differ by rounding.
        attempts: number of the attempt that each point finished in.
        made_of: hash of the points' records, and of what of the plan tables depend on.
    """

    points: tuple[str, ...]
    sources: Mapping[str, int]
    systems: tuple[str, ...]
    made_by: str
    commits: tuple[str, ...]
    dirty: bool
    versions: tuple[str, ...]
    tables: Mapping[str, str]
    kept: tuple[str, ...] = ()
    started: tuple[str, str] = ("", "")
    seconds: float = 0.0
    peak_memory_mb: int = 0
    machines: tuple[str, ...] = ()
    attempts: tuple[int, ...] = ()
    made_of: str = ""


def table_source() -> str:
    """Hash of the source, as it is now, that makes a study's tables of those of its points."""
    return source_hash([_COLLATES])


def collated(
    records: Mapping[str, Mapping[str, Any]],
    tables: Mapping[str, str],
    kept: Iterable[str] = (),
    made_of: str = "",
) -> Collated:
    """What tables came from, of the records of their points.

    Args:
        records: by identity, in the order of the tables' rows.
        tables: sha256 of each table, by its file's name.
        kept: those that were there before and agree with the new ones.
        made_of: hash of all that they are made of.
    """
    each = list(records.values())
    started = [record["started"] for record in each]
    versions = {
        f"{package} {version}"
        for record in each
        for package, version in {"python": record["python"], **record["packages"]}.items()
        if version
    }
    return Collated(
        points=tuple(records),
        sources=dict(sorted(Counter(record["source"] for record in each).items())),
        systems=tuple(sorted({system_module(record["config"]) for record in each})),
        made_by=table_source(),
        commits=tuple(sorted({r["git"]["commit"] for r in each if r["git"]["commit"]})),
        dirty=any(record["git"]["dirty"] for record in each),
        started=(min(started, default=""), max(started, default="")),
        seconds=round(sum(record["seconds"]["total"] for record in each), 1),
        peak_memory_mb=max((record["peak_memory_mb"] for record in each), default=0),
        machines=tuple(sorted({f"{r['cpu']}, {r['cores']} cores, {r['system']}" for r in each})),
        versions=tuple(sorted(versions)),
        tables=tables,
        kept=tuple(sorted(kept)),
        attempts=tuple(int(record.get("attempt", 1)) for record in each),
        made_of=made_of,
    )


@dataclass(frozen=True)
class Study:
    """A study.

    Attributes:
        folder: where it is kept.
        points: the overrides that make each point, by its identity, as they were planned.
        examples: what the study's file says under `examples`, as a plain tree.
        collated: what its tables came from; None before they are written.
    """

    folder: Path
    points: Mapping[str, tuple[str, ...]]
    examples: Mapping[str, Any]
    collated: Collated | None

    @property
    def name(self) -> str:
        return self.folder.name

    def save(self) -> None:
        """Write the listing, and beside it what differs each time that the same is computed."""
        what = plain(self.collated)
        if self.collated is not None:
            runs = {key: what.pop(key) for key in _OF_RUNS}
            write_sealed(_listing(self.folder, RUNS), runs)
        tree = {
            "points": plain(self.points),
            "examples": plain(self.examples),
            "collated": what,
        }
        write_sealed(_listing(self.folder), tree)


def read_study(folder: Path) -> Study | None:
    """The study of a folder, or None if it has no listing.

    Raises:
        StudyError: the listing cannot be read.
    """
    path = folder / "study.json"
    try:
        tree = read_sealed(_listing(folder))
        points = {name: tuple(overrides) for name, overrides in tree["points"].items()}
        what = {**tree["collated"], **_runs(folder)} if tree["collated"] else {}
        lists: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in what.items()
        }
        collated = Collated(**lists) if lists else None
        _check_names(path, points, collated)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StudyError(
            f"{path} cannot be read as a study; the study's own command writes it anew "
            f"({error.strerror if isinstance(error, OSError) else error})"
        ) from None
    return Study(folder, points, tree.get("examples", {}), collated)


def _runs(folder: Path) -> dict[str, Any]:
    """What is told of how a study's points ran; nothing where it cannot be read."""
    try:
        runs = read_sealed(_listing(folder, RUNS))
        return {key: runs[key] for key in _OF_RUNS}
    except (OSError, SealError, KeyError):
        return {}


def _listing(folder: Path, name: str = "study.json") -> Path:
    """The path of a study's listing, whose folder and name are no links."""
    return inner_path(folder.parent, folder.name, name)


def _check_names(path: Path, points: Iterable[object], collated: Collated | None) -> None:
    """Raise unless the points and tables that a study lists are named as such."""
    tables = collated.tables if collated else {}
    identities = [*points, *(collated.points if collated else ())]
    if not (
        all(map(is_identity, identities))
        and all(is_name(name) and is_digest(it) for name, it in tables.items())
    ):
        raise SealError(f"{path} names something that is no point and no table")


def write_plan(
    folder: Path,
    points: Sequence[tuple[Point, Sequence[str]]],
    examples: Mapping[str, Any] | None = None,
) -> None:
    """List the points of a sweep that starts; what is listed of the tables stays.

    Args:
        folder: the study's.
        points: each with the overrides that make it.
        examples: what the study's file says under `examples`.
    """
    before = whole_study(folder)
    planned = {point.identity: tuple(overrides) for point, overrides in points}
    Study(folder, planned, examples or {}, before.collated if before else None).save()


def write_collated(folder: Path, collated: Collated) -> None:
    """List what the tables came from; the plan stays as it is."""
    before = whole_study(folder)
    points = before.points if before else {identity: () for identity in collated.points}
    Study(folder, points, before.examples if before else {}, collated).save()


def whole_study(folder: Path) -> Study | None:
    """The study of a folder, or None if there is none that is whole."""
    try:
        return read_study(folder)
    except StudyError:
        return None
