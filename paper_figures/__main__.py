"""Draw figures from tables: python -m paper_figures [STUDY ...] (default: every study there is)."""

from __future__ import annotations

import os
import signal

if __name__ == "__main__":  # before all that takes time to import: Ctrl-C ends it without a word
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import argparse
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from paper_figures.drawing import draw_study
from paper_figures.selection import Unsuited


def main() -> int:
    """Run the command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="paper_figures", description=__doc__)
    parser.add_argument("study", nargs="*", metavar="STUDY")
    parser.add_argument("--results", type=Path, help="folder of results", metavar="DIR")
    chosen = parser.parse_args()
    results = chosen.results or _default_results()
    studies = chosen.study or sorted(path.parent.name for path in results.glob("*/tables"))
    if not studies:
        raise SystemExit(f"no study in {results}: run one first, python experiments/run.py -m ...")
    with ProcessPoolExecutor(
        min(len(studies), os.cpu_count() or 1),
        mp_context=multiprocessing.get_context("spawn"),  # matplotlib is not made for forks
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_DFL),  # Ctrl-C ends it without a word
    ) as pool:
        drawing = [pool.submit(draw_study, results / study) for study in studies]
        for drawn in drawing:
            try:
                for path in drawn.result():
                    print(f"drawn: {path}", flush=True)
            except Unsuited as reason:
                if chosen.study:
                    raise SystemExit(str(reason)) from None
                print(f"nothing to draw: {reason}")
    return 0


def _default_results() -> Path:
    """`results` of the checkout, or of the current folder where that lies outside of it."""
    root, here = Path(__file__).resolve().parents[1], Path.cwd()
    inside = (root / "conf" / "config.yaml").is_file() and here.is_relative_to(root)
    return (root if inside else here) / "results"


if __name__ == "__main__":
    sys.exit(main())
