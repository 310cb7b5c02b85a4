"""Entries and tables that fit 80 columns."""

from __future__ import annotations

import io

import pytest

from experiments.terminal import WIDTH, counted, entry, fitted, job_names, table_lines


def test_an_entry_breaks_between_words_alone() -> None:
    word = "very-long/" * 9
    lines = entry("written", f"a {word} b-c", hang=2)
    assert lines == ["written         a", f"{'':18}{word}", f"{'':18}b-c"]


def test_one_is_no_plural() -> None:
    assert [counted(count, "point") for count in range(3)] == ["0 points", "1 point", "2 points"]


def test_a_table_leaves_out_columns_that_do_not_fit_and_says_so() -> None:
    rows = [["name", "count", "where"], ["one", 12, "x" * WIDTH], ["three", None, ""]]
    assert list(table_lines(rows, WIDTH)) == [
        "name   count",
        "one       12",
        "three      -",
        "(where: not shown, the terminal is too narrow)",
    ]
    assert max(map(len, table_lines(rows))) > WIDTH


@pytest.mark.parametrize(
    ("jobs", "names"),
    [([["a=1", "b=2"]], ["a=1 b=2"]), ([["a=1", "b='2'"], ["a=1"]], ["b=2", "defaults"])],
)
def test_a_job_is_named_by_what_tells_it_from_the_others(
    jobs: list[list[str]], names: list[str]
) -> None:
    assert job_names(jobs) == names


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_message_breaks_between_words_on_a_terminal_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "21")
    text = "results: nothing can be written\n  raised  a-long-name"
    assert fitted(text, io.StringIO()) == text
    assert fitted(text, Terminal()) == "results: nothing can\n  be written\n  raised  a-long-name"
