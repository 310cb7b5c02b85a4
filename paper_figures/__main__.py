"""Draw figures from tables: python -m paper_figures [STUDY ...] (default: every study there is)."""

from __future__ import annotations

import os
import signal

if __name__ == "__main__":  # before all that takes time to import: Ctrl-C ends it without a word
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import argparse
import sys
from pathlib import Path

from experiments.config.paths import default_results
from paper_figures.drawing import draw_studies

_STOPPED = 130  # the exit status after Ctrl-C


def main() -> int:
    """Run the command line.

    Returns:
        1 if a study that it names makes no figure, or tables are not as they were written; else 0.
    """
    parser = argparse.ArgumentParser(prog="paper_figures", description=__doc__)
    parser.add_argument("study", nargs="*", metavar="STUDY")
    parser.add_argument("--results", type=Path, help="folder of results", metavar="DIR")
    parser.add_argument(
        *("--jobs", "-j"),
        type=_job_count,
        default=-1,
        help="processes that draw, by default one a core (-1)",
        metavar="N",
    )
    parser.add_argument(
        "--again", action="store_true", help="draw also what would stay the same as it is"
    )
    options = parser.parse_args()
    results = options.results or default_results()
    studies = options.study or sorted(path.parent.name for path in results.glob("*/tables"))
    if not studies:
        raise SystemExit(f"no study in {results}: run one first, python experiments/run.py -m ...")
    try:
        return _draw([results / study for study in studies], options)
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
        return 1


def _draw(studies: list[Path], options: argparse.Namespace) -> int:
    """Draw the figures of studies; returns the status of the command."""
    is_complete = True
    for drawing in draw_studies(studies, options.jobs, again=options.again):
        for path in [] if drawing.is_current else drawing.images:
            print(f"drawn: {path}", flush=True)
        if drawing.is_current:
            print(f"up to date: {drawing.study / 'figures'}", flush=True)
        if not drawing.images:
            print(f"nothing to draw: {drawing}", flush=True)
            is_complete = is_complete and not options.study
        is_complete = is_complete and not drawing.damage
    return 0 if is_complete else 1


def _job_count(text: str) -> int:
    """The number of processes that the command line asks for."""
    if (number := int(text)) == 0:
        raise argparse.ArgumentTypeError("0 processes draw nothing; -1 is one a core")
    return number


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # joblib stops its workers
    try:
        status = main()
    except KeyboardInterrupt:
        status = _STOPPED
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # while the interpreter ends
    sys.exit(status)
