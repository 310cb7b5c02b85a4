"""`python -m experiments.field`: the benchmark, from worlds to the leaderboard's page."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from experiments.config.paths import default_results
from experiments.field.catalog import chosen, load
from experiments.field.contest import contest
from experiments.field.entries import EntryError
from experiments.field.page import write_results
from experiments.field.published import false_shares
from experiments.tracking.files import make_writable

SEEDS = 7  # about three processor minutes each
_DRAWS = 5  # sets of demonstrations beside published numbers, for each seed: they are cheap
_PUBLISHED = {"Scobee and Sastry", "ours: greedy"}  # what published numbers are of


def main(arguments: list[str] | None = None) -> int:
    """Run what is missing, then write tables, picture and page."""
    parser = _parser()
    options = parser.parse_args(arguments)
    shown = options.demonstrations
    if min(options.seeds, 1 if shown is None else shown) < 1:
        parser.error("--seeds and --demonstrations are at least 1")
    if options.workers == 0:
        parser.error("--workers is a number of processes, or -1 for one a core; not 0")
    if options.out.exists() and not options.out.is_dir():
        parser.error(f"--out is a folder of results; {options.out} is a file")
    added = tuple(path.resolve() for path in options.add)
    try:
        catalog = load(added)
        worlds = chosen(list(catalog.worlds), options.worlds, "world")
        methods = chosen(list(catalog.methods), options.methods, "method")
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{len(worlds)} worlds, {len(methods)} methods, {options.seeds} seeds", flush=True)
    seeds = range(options.seeds)
    try:
        make_writable(options.out)
    except OSError as error:
        parser.error(
            f"--out: nothing can be written into {options.out} ({error.strerror}); name a folder "
            "of your own"
        )
    try:
        runs = contest(options.out, worlds, methods, seeds, added, options.workers, shown)
    except EntryError as error:
        print(error, file=sys.stderr)
        return 2
    published = None
    if {*worlds, *methods} >= _PUBLISHED:
        published = false_shares(range(_DRAWS * options.seeds))
    print(write_results(options.out, runs, catalog, published))
    return 0


def _parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(prog="experiments.field", description=__doc__)
    parser.add_argument("--worlds", nargs="+", help="names of worlds; all if none are given")
    parser.add_argument("--methods", nargs="+", help="names of methods; all if none are given")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="how many seeds [%(default)s]")
    parser.add_argument("--demonstrations", type=int, help="how many each world shows")
    parser.add_argument("--workers", type=int, default=-1, help="processes [one a core]")
    parser.add_argument(
        "--out", type=Path, default=default_results() / "field", help="folder of results"
    )
    parser.add_argument(
        "--add",
        nargs="+",
        type=Path,
        default=[],
        help="files with WORLDS or METHODS, folders of recordings",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
