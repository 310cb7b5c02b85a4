"""Which step a command is at, on the last line of a terminal.

Whatever takes time calls `begin` with the step's name, wherever it is; `steps_shown` listens.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm

_LOG = logging.getLogger(__name__)
_PAUSE = 0.5  # [s] between looks at the clock


def begin(step: str) -> None:
    """Say that a step begins; an empty one leaves the line to what is printed next."""
    _LOG.info(step)


@contextmanager
def steps_shown() -> Iterator[None]:
    """Show the step that this block is at and the time since it began; nothing off a terminal."""
    with tqdm(bar_format="{desc} [{elapsed}]", leave=False, disable=None) as bar:
        if bar.disable:
            yield
            return
        handler, before, ended = _Shown(bar), _LOG.level, threading.Event()

        def tick() -> None:
            while not ended.wait(_PAUSE):
                if bar.desc:
                    bar.refresh()

        clock = threading.Thread(target=tick, daemon=True)
        _LOG.addHandler(handler)
        _LOG.setLevel(logging.INFO)
        clock.start()
        try:
            yield
        finally:
            _LOG.removeHandler(handler)
            _LOG.setLevel(before)
            ended.set()
            clock.join()


class _Shown(logging.Handler):
    """Shows messages in a bar, one after the other."""

    def __init__(self, bar: tqdm[Any]) -> None:
        super().__init__()
        self._bar = bar

    def emit(self, record: logging.LogRecord) -> None:
        self._bar.set_description_str(record.getMessage(), refresh=False)
        if record.getMessage():
            self._bar.refresh()
        else:
            self._bar.clear()
