"""Look back at what was computed: python experiments/results.py COMMAND ..."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import app

    sys.exit(app.results())

import argparse
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from experiments.config.paths import CHECKOUT, default_results
from experiments.lookback.archive import Archive, ArchiveError, Facts, reason
from experiments.lookback.cleaning import clean, empty_trash
from experiments.lookback.freshness import is_shipped, point_concerns
from experiments.lookback.query import select
from experiments.lookback.views import (
    differences,
    point_facts,
    point_list,
    study_facts,
    study_list,
    study_status,
    summary_list,
)
from experiments.terminal import complain, counted, terminal_width
from experiments.tracking.files import replace_file
from experiments.tracking.points import State
from experiments.tracking.study import Study

_PURPOSE = """\
Look back at what was computed: list, compare, export and clean points and
studies. The beginning of a point's identity is enough to name it."""
# Three calls of each subcommand.
_EXAMPLES = {
    "status": ("", "paper", "paper --results results/smoke"),
    "list": ("", "paper", "points --state failed --state stale"),
    "show": ("paper", "cda5fa", "cda5fa --results results/smoke"),
    "diff": ("cda5fa 04c07c", "cda5 04c0", "cda5fa 04c07c --results results/smoke"),
    "page": ("cda5fa", "cda5fa --out page.html", "cda5fa --results results/smoke"),
    "query": ("truth=c1 'dt<=0.5'", "cells=400 --study paper", "'final_state_error>1'"),
    "export": ("paper", "paper --out paper.csv", "paper --table ranks"),
    "demonstrations": (
        "cda5fa --out recorded",
        "cda5fa --out ~/recorded",
        "cda5fa --out /tmp/recorded",
    ),
    "clean": ("", "--yes", "--results results/smoke"),
    "empty-trash": ("", "--results results/smoke", "--results /tmp/results"),
}


def _examples(*calls: str) -> str:
    """Calls of this command, as one types them."""
    name = "mlci-results" if CHECKOUT is None else "python experiments/results.py"
    return "\n".join(["examples:", *(f"  {name} {call}".rstrip() for call in calls)])


def main() -> int:
    """Run the command line.

    Returns:
        0; 2 if something that was asked for is not there.
    """
    options = _parser().parse_args()
    folder = options.results or _results_of_path(options) or default_results()
    results = Path(os.path.realpath(os.path.expanduser(folder)))
    if isinstance(sys.stdout, io.TextIOWrapper):  # names of files need not suit a terminal
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        if results.exists() and not results.is_dir():
            raise ArchiveError(f"--results: {results} is no folder")
        for line in options.command(Archive(results), options):
            print(line)
        print(end="", flush=True)
    except ArchiveError as error:
        complain(str(error))
        return 2
    except OSError as error:
        try:
            print(end="", flush=True)
        except OSError:  # it would be tried again as this process ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):  # somebody has read enough
            return 0
        complain(reason(error))
        return 2
    return 0


def _results_of_path(options: argparse.Namespace) -> Path | None:
    """The folder of results that a point lies in, where it is named by its folder."""
    for name in ("point", "name", "one"):
        path = Path(os.path.realpath(os.path.expanduser(getattr(options, name, ""))))
        if path.parent.name == "points" and path.is_dir():
            return path.parent.parent
    return None


def _parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=_PURPOSE,
        epilog=_examples("status", "list paper", "query truth=c1 'dt<=0.5'"),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="the version of mlci")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--results", type=Path, help="folder of results", metavar="DIR")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, command: Any, text: str) -> argparse.ArgumentParser:
        subparser = commands.add_parser(
            name,
            help=text,
            description=f"{text[0].upper()}{text[1:]}.",
            epilog=_examples(*(f"{name} {words}" for words in _EXAMPLES[name])),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            parents=[common],
        )
        subparser.set_defaults(command=command)
        return subparser

    one = add("list", _list, "studies; or the points of one, or with `points` all points")
    one.add_argument("study", nargs="?", metavar="STUDY")
    one.add_argument("--state", action="append", choices=list(State), help="only points in it")
    one = add("status", _status, "what is done, and which tables and figures are up to date")
    one.add_argument("study", nargs="?", metavar="STUDY")
    one = add("show", _show, "config, record and results of a point or a study")
    one.add_argument("name", metavar="POINT|STUDY", help="an identity's beginning is enough")
    one = add("diff", _diff, "what differs between two points: config, versions, results")
    one.add_argument("one", metavar="A")
    one.add_argument("two", metavar="B")
    one = add("query", _query, "finished points by config or summary, with their summary")
    one.add_argument("conditions", nargs="+", metavar="KEY=VALUE", help="also 'dt<=0.25', != ...")
    one.add_argument("--study", help="points of this study only")
    one = add("export", _export, "one tidy table: each point's config, origin and measures")
    one.add_argument("study", metavar="STUDY")
    one.add_argument("--table", default="summary", help="whose rows; summary has one a point")
    one.add_argument("--format", choices=["csv", "parquet"], default="csv")
    one.add_argument("--out", type=Path, metavar="FILE", help="default: the terminal")
    one = add("demonstrations", _demonstrations, "a point's demonstrations, as recorded files")
    one.add_argument("point", metavar="POINT")
    one.add_argument("--out", type=Path, metavar="FOLDER", required=True, help="new or empty")
    one = add("page", _page, "a point's answer as a web page, with a map to click")
    one.add_argument("point", metavar="POINT")
    one.add_argument("--out", type=Path, metavar="FILE", help="default: page-POINT.html here")
    one = add("clean", _clean, "list what no study uses: points, stored stages, dead files")
    one.add_argument("--yes", action="store_true", help="move it into the folder `trash`")
    add("empty-trash", _empty_trash, "remove what clean --yes has moved into the folder `trash`")
    return parser


def _list(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """Studies, or points."""
    if options.study is None and not options.state:
        return study_list(archive, terminal_width())
    study = None if options.study in (None, "points") else archive.study(options.study)
    return point_list(archive, study, options.state or (), terminal_width())


def _status(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """States of points, tables and figures, by study."""
    if options.study:
        yield from study_status(archive, archive.study(options.study), terminal_width())
        return
    yield from archive.unreadable
    for study in archive.studies.values():
        yield from study_status(archive, study, terminal_width())
    if not archive.studies:
        yield f"no study in {archive.results}"


def _show(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """All about a point or a study."""
    item = archive.find(options.name)
    if isinstance(item, Study):
        return study_facts(archive, item, terminal_width())
    return point_facts(archive, item)


def _diff(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """What differs between two points."""
    one, two = (_point(archive, name) for name in (options.one, options.two))
    return differences(archive, one, two, terminal_width())


def _query(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """Points that meet conditions, with their summary."""
    if options.study is None:
        points = list(archive.points.values())
    else:
        points = archive.points_of(archive.study(options.study))
    matches = select([point for point in points if point.record], options.conditions)
    if not matches:
        raise ArchiveError(f"no finished point has {' '.join(options.conditions)}")
    return summary_list(matches, terminal_width())


def _export(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """One table of a study."""
    from experiments.lookback.export import file_bytes, tidy_table  # pandas

    if options.format == "parquet" and options.out is None:
        raise ArchiveError("--format parquet needs --out FILE: it is no text for a terminal")
    points = archive.points_of(archive.study(options.study))
    finished = [point for point in points if point.record]
    if not finished:
        raise ArchiveError(f"{options.study}: no point is finished; run the sweep first")
    table = tidy_table(finished, options.table)
    data = file_bytes(table, options.format)
    concerns = point_concerns(points)
    if is_shipped(points):
        concerns.append("some points are not stored here, and their rows are left out")
    if concerns:
        complain(f"{options.study}: {', '.join(concerns)}")
    if options.out is None:
        yield data.decode().rstrip("\n")
    else:
        _write(options.out, data)
        yield f"written: {options.out} ({counted(len(table), 'row')}, {table.shape[1]} columns)"


def _demonstrations(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """Recorded files of a point's demonstrations."""
    from experiments.lookback.recordings import write_recordings  # mlci

    files = write_recordings(_point(archive, options.point), options.out)
    yield f"written: {counted(len(files), 'demonstration')} into {options.out}"
    yield f"rank by them: python experiments/infer.py demonstrations={options.out}"


def _page(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """The page of a point."""
    from experiments.config.problems import ConfigError
    from experiments.page.of_point import point_page  # what infers takes a second to import
    from experiments.point.no_answer import NoAnswer

    facts = _point(archive, options.point)
    path = options.out or Path(f"page-{facts.point.identity[:12]}.html")
    try:
        page = point_page(facts)
    except (ConfigError, NoAnswer) as error:
        raise ArchiveError(f"{facts.point.identity}: {error}") from None
    except (LookupError, TypeError) as error:
        message = f"{facts.point.identity}: its record is not as points write them: {error!r}"
        raise ArchiveError(message) from None
    _write(path, page.encode())
    yield f"written: {path}"


def _clean(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """What no study uses; moved into the trash if told."""
    return clean(archive, remove=options.yes)


def _empty_trash(archive: Archive, options: argparse.Namespace) -> Iterator[str]:
    """What was cleaned, removed for good."""
    return empty_trash(archive.results)


def _write(path: Path, data: bytes) -> None:
    """Write what was asked for into a file.

    Raises:
        ArchiveError: it cannot be written, or there is something else, such as a device.
    """
    target = Path(os.path.realpath(path))
    try:
        if target.exists() and not target.is_file():
            raise ArchiveError(f"--out: {path} is no file, which could be replaced")
        replace_file(target, data)
    except OSError as error:
        raise ArchiveError(f"--out: {path} cannot be written: {error.strerror}") from None


def _point(archive: Archive, name: str) -> Facts:
    """A point that was asked for."""
    item = archive.find(name)
    if isinstance(item, Study):
        raise ArchiveError(f"{name}: is a study; give a point (see: list {name})")
    return item
