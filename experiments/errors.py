"""What went wrong, in words for the person at the terminal."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml
from hydra.errors import (
    HydraException,
    InstantiationException,
    MissingConfigException,
    OverrideParseException,
)
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from experiments.config import ConfigError, known_keys
from experiments.record import CHECKOUT
from experiments.schema import did_you_mean

CONF = CHECKOUT / "conf"


def explain(error: BaseException) -> str:
    """One line for each thing to put right, where a config or a command line is at fault.

    Raises:
        the error itself, where it is of another kind: that is a defect, not a wrong config.
    """
    if isinstance(error, ConfigError):
        return str(error)
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.rpartition("/")
        options = sorted(error.options or (), key=lambda option: (len(option), option))
        known = f"; there are {', '.join(options)}" if options else ""
        return f"{group or 'config'}: there is no {name}{known}"
    if isinstance(error, OverrideParseException):
        return f"{error.override}: cannot be read as key=value ({_first_line(error)})"
    if isinstance(error, yaml.YAMLError | UnicodeDecodeError):
        return _broken_file(error)
    if isinstance(error, InstantiationException):
        raise error
    if isinstance(error, HydraException | OmegaConfBaseException):
        return _explain_override(error)
    if _raised_in(error).partition(".")[0] in ("hydra", "omegaconf", "antlr4", "yaml"):
        return f"the config cannot be composed: {_first_line(error)}"
    raise error


def _explain_override(error: HydraException | OmegaConfBaseException) -> str:
    """What is wrong with an override that could be read, but not applied."""
    if several := re.search(r"Ambiguous value for argument '(.+)'", str(error)):
        key, _, values = several[1].partition("=")
        return f"{key}: several values need -m, for a sweep, or {key}=[{values}], for a list"
    if unknown := re.search(r"Could not override '([^']+)'", str(error)):
        key = unknown[1]
        parent = getattr(error.__cause__, "parent_node", None)
        known = [str(name) for name in parent] if isinstance(parent, DictConfig) else known_keys()
        return f"{key}: unknown key{did_you_mean(key.rpartition('.')[2], known)}"
    key = getattr(error.__cause__ or error, "full_key", None)
    return f"{key}: {_first_line(error)}" if key else _first_line(error)


def gather(problems: Mapping[str, Sequence[str]], total: int) -> str:
    """The problems of a sweep's points: each once, with the points that have it."""
    lines = []
    for problem, jobs in problems.items():
        where = "all points" if len(jobs) == total else f"{len(jobs)} of {total} points"
        example = f", such as {jobs[0]}" if len(jobs) < total else ""
        lines.append(f"{problem} [{where}{example}]" if total > 1 else problem)
    return "\n".join(lines)


def job_names(jobs: Sequence[Sequence[str]]) -> list[str]:
    """What tells each job from the others, as a person would type it."""
    shared = set(jobs[0]).intersection(*jobs) if len(jobs) > 1 else set()
    return [" ".join(part for part in job if part not in shared).replace("'", "") for job in jobs]


def describe_failures(failed: Mapping[str, Exception], total: int) -> str:
    """The tracebacks of failed points by name, then a line for each."""
    texts, lines = [], []
    for name, error in failed.items():
        # The pool keeps a worker's traceback as text on the exception.
        texts.append(f"--- {name}\n{getattr(error, 'traceback', '') or error}".rstrip())
        lines.append(f"  {name}: {type(error).__name__}: {_first_line(error)}")
    summary = (
        f"{len(failed)} of {total} points failed, and no table is written; the others are kept, "
        "and the same command runs what is missing:"
    )
    return "\n".join([*texts, summary, *lines])


def _first_line(error: BaseException) -> str:
    """The first line of an error's message."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _raised_in(error: BaseException) -> str:
    """Name of the module that raised an error."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return str(trace.tb_frame.f_globals.get("__name__", "")) if trace else ""


def _broken_file(error: Exception) -> str:
    """Which config file cannot be read, and where."""
    if mark := getattr(error, "problem_mark", None):
        return f"{mark.name}, line {mark.line + 1}: not valid YAML ({_first_line(error)})"
    named = [Path(word.rpartition("=")[2]) for word in sys.argv[1:]]  # by --config-dir
    folders = [CONF, *(folder for folder in named if folder.is_dir())]
    for path in sorted(path for folder in folders for path in folder.rglob("*.yaml")):
        try:
            path.read_text(encoding="utf-8")
        except UnicodeDecodeError as found:
            return f"{path}: byte {found.start} is not UTF-8; save the file as UTF-8"
    return f"a config file cannot be read: {_first_line(error)}"
