"""The step that a command is at: on a terminal, where it is gone when something is printed."""

from __future__ import annotations

import io
import logging

import pytest

from experiments.progress import begin, steps_shown


class Terminal(io.StringIO):
    """What a terminal is given to show."""

    def isatty(self) -> bool:
        return True


@steps_shown()
def work() -> None:
    begin("reading")
    begin("ranking")
    begin("")
    assert logging.getLogger("experiments.progress").handlers


def test_steps_are_shown_one_after_the_other_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    work()
    shown = [line.strip() for line in terminal.getvalue().split("\r")]
    texts = [line.partition("[")[0].strip() for line in shown if line]
    assert [text for text in texts if text] == ["reading", "ranking"]
    assert shown[-1] == ""  # the line is free again
    assert not logging.getLogger("experiments.progress").handlers


@steps_shown()
def first_work_on_a_machine() -> None:
    begin("ranking")
    logging.getLogger("mlci.compiled").info("compiling")
    logging.getLogger("mlci.compiled").info("compiled")
    begin("measuring")


def test_a_terminal_shows_what_is_compiled_beside_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    first_work_on_a_machine()
    lines = [line.partition("[")[0].strip() for line in terminal.getvalue().split("\r")]
    steps = ["ranking", "ranking: compiling", "ranking: compiled", "measuring"]
    assert [line for line in lines if line] == steps
    assert not logging.getLogger("mlci.compiled").handlers


@pytest.mark.parametrize(("quiet", "lines"), [(1e6, ""), (0.0, "... reading\n... ranking\n")])
def test_elsewhere_a_line_tells_now_and_then(
    monkeypatch: pytest.MonkeyPatch, quiet: float, lines: str
) -> None:
    file = io.StringIO()
    monkeypatch.setattr("sys.stderr", file)
    with steps_shown(quiet):
        begin("reading")
        begin("ranking")
        begin("")
    begin("what nobody listens to")
    assert file.getvalue() == lines
