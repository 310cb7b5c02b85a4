"""Words of the command line, before and after Hydra reads them."""

from __future__ import annotations

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given
from hypothesis import strategies as st

from experiments.config.command_line import command_words, quote_path
from experiments.config.problems import ConfigError

TEXTS = ["rec (1)", "naïve", "2024", "007", "1e3", "true", "a=b", "~/x", "rec[12].csv", "[x].csv"]
TEXTS += [
    "it's",
    "#1",
    "a,b",
    "{a}",
    "a:b",
    "a b",
    "end\\",
    "a\\'b",
    "null.csv",
    "*.csv",
    "d\udcff",
]


def parsed(word: str) -> object:
    """The value that Hydra reads."""
    return OverridesParser.create().parse_override(word).value()


@pytest.mark.parametrize("path", TEXTS)
def test_a_path_is_text(path: str) -> None:
    assert parsed(quote_path(f"demonstrations={path}")) == path
    if "," not in path:
        assert parsed(quote_path(f"results={path}")) == path


@given(
    st.text(st.characters(exclude_characters="${[\"'\n\r\0", exclude_categories=["Cs"]), min_size=1)
)
def test_any_text_without_quotes_is_kept(path: str) -> None:
    assert parsed(quote_path(f"demonstrations=x{path}")) == f"x{path}"


@pytest.mark.parametrize(
    "word",
    [
        "demonstrations=[a,b]",
        "demonstrations=['rec (1)']",
        "demonstrations='a b'",
        'results="a b"',
        "results=null",
        "results=a,b",  # two folders at once, which a sweep refuses
        "results=",
        "demonstrations=${results}",
        "dt=0.5",
        "-m",
    ],
)
def test_other_words_stay_as_they_are(word: str) -> None:
    assert quote_path(word) == word


def test_a_word_that_is_not_utf_8_is_refused_with_a_pattern() -> None:
    with pytest.raises(
        ConfigError, match=r"^demonstrations=a\\udcff.csv: byte 0xff is .*=a\?.csv$"
    ):
        command_words(["demonstrations=a\udcff.csv"])
