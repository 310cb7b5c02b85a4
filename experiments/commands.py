"""The commands: what they do is imported late, so that Ctrl-C ends them quietly from the start."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from typing import Any

STOPPED = 130


def run() -> int:
    """`mlci-run`: experiments/run.py."""
    return _start("experiments.run")


def infer() -> int:
    """`mlci-infer`: experiments/infer.py."""
    return _start("experiments.infer")


def advise() -> int:
    """`mlci-advise`: experiments/advise.py."""
    return _start("experiments.advise")


def results() -> int:
    """`mlci-results`: experiments/results.py."""
    return _start("experiments.results")


def figures() -> int:
    """`mlci-figures`: paper_figures."""
    return _start("paper_figures.__main__")


def report() -> int:
    """`mlci-report`: paper_report."""
    return _start("paper_report.__main__")


def _start(module: str) -> int:
    """Import a module, which takes a second, and run its `main`; returns the exit status.

    Modules of the current folder can be imported by name, such as those of a user's own system.
    """
    # After all others, so that it hides none of them; workers get the same. Python itself adds the
    # folder of the file that it was given, where a module of ours could be taken for a user's.
    ours = os.path.dirname(os.path.abspath(__file__))
    sys.path[:] = [path for path in sys.path if os.path.abspath(path) != ours] + [os.getcwd()]
    usual = signal.getsignal(signal.SIGINT)
    if usual is not signal.SIG_IGN:  # as in the background of a script
        signal.signal(signal.SIGINT, _leave)
    main = import_module(module).main
    try:
        signal.signal(signal.SIGINT, usual)
        status: int = main()
    except KeyboardInterrupt:
        status = STOPPED
    if usual is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)  # while the interpreter ends
    return status


def _leave(*_: Any) -> None:
    """End without a word, as nothing has begun, or all is done; an exception might be caught."""
    os._exit(STOPPED)
