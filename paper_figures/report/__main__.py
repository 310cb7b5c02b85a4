"""Write the report: python -m paper_figures.report [--results DIR]

It reads tables and figures only, and writes REPORT.md and REPORT.html into the folder of the study
`paper`.
"""

from __future__ import annotations

import os
import signal

if __name__ == "__main__":  # before all that takes time to import: Ctrl-C ends it without a word
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import argparse
import sys
from pathlib import Path

from experiments.config.paths import default_results
from experiments.tracking.files import replace_file
from experiments.tracking.names import inner_path
from experiments.tracking.report_note import write_note
from paper_figures.report import page
from paper_figures.report.document import FOLDER, report
from paper_figures.report.study_tables import Results

_STOPPED = 130  # the exit status after Ctrl-C


def main() -> int:
    """Run the command line; returns 1 if tables or figures are not as they were written, else 0."""
    parser = argparse.ArgumentParser(prog="paper_figures.report", description=__doc__)
    parser.add_argument("--results", type=Path, help="folder of results", metavar="DIR")
    options = parser.parse_args()
    results = Results((options.results or default_results()).resolve())
    if not results.studies():
        raise SystemExit(
            f"no study in {results.folder}: run one first, python experiments/run.py -m ..."
        )
    try:
        for path in write(results):
            print(f"written: {path}")
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    for damage in dict.fromkeys(results.damage):
        print(damage, file=sys.stderr)
    return 1 if results.damage else 0


def write(results: Results) -> list[Path]:
    """Write REPORT.md and REPORT.html, and what they come from; returns the paths of the two."""
    folder, text = inner_path(results.folder, FOLDER), report(results)
    contents = {"REPORT.md": text.encode(), "REPORT.html": page.html(text, folder).encode()}
    for name, content in contents.items():
        replace_file(folder / name, content)
    write_note(folder, results.digests, contents)
    return [folder / name for name in contents]


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # files are finished or removed
    try:
        status = main()
    except KeyboardInterrupt:
        status = _STOPPED
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # while the interpreter ends
    sys.exit(status)
