"""Which step a command is at: on the last line of a terminal, or now and then a line of a file.

Whatever takes time calls `begin` with the step's name, wherever it is; `steps_shown` listens. It
also shows that loops are compiled, which mlci logs the first time that a machine needs them.
"""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tqdm import tqdm

_LOG = logging.getLogger(__name__)
_COMPILES = logging.getLogger("mlci.compiled")
_PAUSE = 0.5  # [s] between looks at the clock
_QUIET = 30.0  # [s] of processor time between lines that are no terminal's: short runs print none


def begin(step: str) -> None:
    """Say that a step begins; an empty one leaves the line to what is printed next."""
    _LOG.info(step)


@contextmanager
def steps_shown(quiet: float = _QUIET) -> Iterator[None]:
    """Show the step that this block is at and the time since it began.

    Args:
        quiet: processor time [s] that passes between two lines where there is no terminal.
    """
    from tqdm import tqdm

    with tqdm(bar_format="{desc} [{elapsed}]", leave=False, disable=None) as bar:
        if bar.disable:
            lines = _Lines(quiet)
            level = _LOG.level
            _LOG.addHandler(lines)
            _LOG.setLevel(logging.INFO)
            try:
                yield
            finally:
                _LOG.removeHandler(lines)
                _LOG.setLevel(level)
            return
        handler, ended = _Shown(bar), threading.Event()
        before = {log: log.level for log in (_LOG, _COMPILES)}

        def tick() -> None:
            while not ended.wait(_PAUSE):
                if bar.desc:
                    bar.refresh()

        clock = threading.Thread(target=tick, daemon=True)
        for log in before:
            log.addHandler(handler)
            log.setLevel(logging.INFO)
        clock.start()
        try:
            yield
        finally:
            for log, level in before.items():
                log.removeHandler(handler)
                log.setLevel(level)
            ended.set()
            clock.join()


class _Lines(logging.Handler):
    """Prints a message to standard error where the last is some processor time ago."""

    def __init__(self, quiet: float) -> None:
        super().__init__()
        self._quiet = quiet
        self._last = time.process_time()

    def emit(self, record: logging.LogRecord) -> None:
        text, now = record.getMessage(), time.process_time()
        if text and now - self._last >= self._quiet:
            print(f"... {text}", file=sys.stderr, flush=True)
            self._last = now


class _Shown(logging.Handler):
    """Shows messages in a bar, one after the other."""

    def __init__(self, bar: tqdm[Any]) -> None:
        super().__init__()
        self._bar = bar
        self._step = ""

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if record.name == _LOG.name:
            self._step = text
        elif self._step:
            text = f"{self._step}: {text}"
        self._bar.set_description_str(text, refresh=False)
        if text:
            self._bar.refresh()
        else:
            self._bar.clear()
