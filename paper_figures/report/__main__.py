"""Write the report: python -m paper_report [--results DIR]

It reads tables and figures only, and writes REPORT.md and REPORT.html into the folder of the study
`paper`. In a checkout it also renews the numbers in README.md.
"""

from __future__ import annotations

import os
import signal

if __name__ == "__main__":  # before all that takes time to import: Ctrl-C ends it without a word
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import argparse
import sys
from pathlib import Path

from paper_figures.report import page, readme
from paper_figures.report.report import FOLDER, report
from paper_figures.report.study_tables import Results

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    """Run the command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="paper_report", description=__doc__)
    parser.add_argument("--results", type=Path, help="folder of results", metavar="DIR")
    chosen = parser.parse_args()
    checkout = (ROOT / "conf" / "config.yaml").is_file()
    folder = (chosen.results or (ROOT if checkout else Path.cwd()) / "results").resolve()
    results = Results(folder)
    if not results.studies():
        raise SystemExit(f"no study in {folder}: run one first, python experiments/run.py -m ...")
    for path in write(results):
        print(f"written: {path}")
    if chosen.results is None and checkout:
        path = ROOT / "README.md"
        text = path.read_text()
        path.write_text(readme.renewed(text, results))
        print(f"numbers renewed: {path}")
    return 0


def write(results: Results) -> list[Path]:
    """Write REPORT.md and REPORT.html; returns their paths."""
    folder = results.folder / FOLDER
    folder.mkdir(exist_ok=True)
    text = report(results)
    paths = [folder / "REPORT.md", folder / "REPORT.html"]
    for path, content in zip(paths, (text, page.html(text, folder)), strict=True):
        path.write_text(content)
    return paths


if __name__ == "__main__":
    sys.exit(main())
