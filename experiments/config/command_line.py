"""The current folder's own configs and modules, which join those that come with mlci."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from experiments.config.paths import CONF, is_inside_checkout
from experiments.config.problems import ConfigError

PATHS = ("demonstrations", "results", "table", "tasks")  # keys whose values are paths
_NOT_TEXT = re.compile(r"[\ud800-\udfff]")  # bytes that are not UTF-8, as Python has them


def command_words(words: Sequence[str]) -> list[str]:
    """A command line for Hydra, that finds the configs in `conf` of the current folder too.

    Raises:
        ConfigError: a word is not UTF-8; one of the configs there has the name of ours, which would
            be taken in its place; a subject, whose file is composed last, would silently overrule
            another word; or another sweeper than ours.
    """
    for word in words:
        if odd := _NOT_TEXT.search(word):
            shown = word.encode("utf-8", "backslashreplace").decode("utf-8")
            raise ConfigError(
                f"{shown}: byte {ord(odd[0]) & 0xFF:#x} is not UTF-8, as a config must be; name "
                f"the folder, or a pattern: {_NOT_TEXT.sub('?', word)}"
            )
    # Hydra wants -m before, or after, all overrides.
    ordered = [
        quote_path(quote_options(w))
        for w in sorted(words, key=lambda w: w not in ("-m", "--multirun"))
    ]
    own = Path.cwd() / "conf"
    named = any(word.partition("=")[0] in ("--config-dir", "-cd") for word in words)
    given = {word.partition("=")[0]: word for word in words}
    if (sweeper := given.get("hydra/sweeper", "hydra/sweeper=planner")) != "hydra/sweeper=planner":
        raise ConfigError(f"{sweeper}: sweeps are planned by mlci's own sweeper; leave this out")
    if "subject" in given:
        for group in given.keys() & {"system", "truth", "grid"}:
            raise ConfigError(
                f"{given[group]}: a subject brings its own; change values, such as grid.shape=[8,8]"
            )
        path = own / "subject" / f"{given['subject'].partition('=')[2]}.yaml"
        if not (named or path.is_file()):
            raise ConfigError(
                f"{given['subject']}: there is no {path}; go to the folder of your system, or add "
                "--config-dir=CONF"
            )
    if named or is_inside_checkout() or not own.is_dir():
        return ordered
    for path in sorted(own.glob("*/*.yaml")):
        if (CONF / path.relative_to(own)).exists():
            name = path.relative_to(own).with_suffix("")
            raise ConfigError(f"{path}: mlci comes with a {name} of its own; rename this file")
    return [*ordered, f"--config-dir={own}"]


def quote_path(argument: str) -> str:
    """demonstrations=rec (1) as demonstrations='rec (1)': a path is text, without a grammar.

    A list of paths, what is quoted, and an interpolation stay as they are; so does `results=a,b`,
    which asks for two folders at once, and is refused.
    """
    key, _, value = argument.partition("=")
    as_it_is = re.match(r"""null$|["']|\[.*\]$|\$\{""", value, re.DOTALL)
    if key not in PATHS or not value or as_it_is or (key == "results" and "," in value):
        return argument
    # Hydra's grammar: before a quote, or at the end, backslashes are doubled.
    escaped = re.sub(r"(\\*)'", r"\1\1\\'", value)
    return f"{key}='" + re.sub(r"(\\+)$", r"\1\1", escaped) + "'"


def quote_options(argument: str) -> str:
    """grid=100,400 as grid='100','400': Hydra takes a bare number for a value, not an option."""
    key, _, values = argument.partition("=")
    if not re.fullmatch(r"\d+(,\d+)*", values) or not (key and os.path.isdir(CONF / key)):
        return argument
    return key + "=" + ",".join(f"'{value}'" for value in values.split(","))
