"""What went wrong, in words for the person at the terminal."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import yaml
from hydra.errors import (
    HydraException,
    InstantiationException,
    MissingConfigException,
    OverrideParseException,
)
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from experiments.config.command_line import PATHS
from experiments.config.paths import CONF
from experiments.config.problems import ConfigError, field_keys
from experiments.config.settings import RunSettings
from experiments.config.suggestions import did_you_mean


def explain(error: BaseException) -> str:
    """One line for each thing to put right, where a config or a command line is at fault.

    Raises:
        the error itself, where it is of another kind: that is a defect, not a wrong config.
    """
    if isinstance(error, ConfigError):
        return str(error)
    if isinstance(error, MissingConfigException):
        if error.missing_cfg_file is None:
            return " ".join(str(error).split())
        group, _, name = error.missing_cfg_file.rpartition("/")
        options = sorted(error.options or (), key=lambda option: (len(option), option))
        known = f"; there are {', '.join(options)}" if options else ""
        return f"{group or 'config'}: there is no {name}{known}"
    if isinstance(error, OverrideParseException):
        words, (key, _, value) = _short(error.override), error.override.partition("=")
        example = f"{key}=['{value.strip('[]')}']"
        hint = f'; quote each path, as in "{example}"' if key in PATHS else ""
        return f"{words}: cannot be read as key=value ({_first_line(error)}){hint}"
    if isinstance(error, InstantiationException) and error.__cause__:
        key = str(error).rpartition("full_key: ")[2]  # of the sweeper or the launcher
        return f"{key}: {_first_line(error.__cause__)}"
    if not of_config(error):
        raise error
    if broken := _broken_file():
        return broken
    if isinstance(error, HydraException | OmegaConfBaseException):
        return _explain_override(error)
    # Neither the file nor the key is known.
    words = " ".join(_short(word) for word in sys.argv[1:])
    return f"{words}: the config cannot be composed: {_first_line(error)}"


def of_config(error: BaseException) -> bool:
    """Whether an error was raised while Hydra read and composed the config."""
    composing = ("hydra", "omegaconf", "antlr4", "yaml")
    trace, names = error.__traceback__, [""]
    while trace is not None:
        names.append(trace.tb_frame.f_globals.get("__name__", ""))
        trace = trace.tb_next
    return (
        isinstance(error, HydraException | OmegaConfBaseException | yaml.YAMLError | UnicodeError)
        or names[-1].partition(".")[0] in composing
        # What recurses too deeply, or has too long a name, may be noticed anywhere.
        or any(re.match(r"hydra\._internal\.(config_|defaults_list)", name) for name in names)
    )


def _explain_override(error: HydraException | OmegaConfBaseException) -> str:
    """What is wrong with an override that could be read, but not applied."""
    if several := re.search(r"Ambiguous value for argument '(.+)'", str(error)):
        key, _, values = several[1].partition("=")
        return f"{key}: several values need -m, for a sweep, or {key}=[{values}], for a list"
    if re.search(r"Could not (override|delete) ''", str(error)):
        return f"{' '.join(map(_short, sys.argv[1:]))}: cannot be read as key=value"
    if unknown := re.search(r"Could not override '([^']+)'", str(error)):
        key = unknown[1]
        parent = getattr(error.__cause__, "parent_node", None)
        known = [str(name) for name in parent] if isinstance(parent, DictConfig) else _known_keys()
        return f"{key}: unknown key{did_you_mean(key.rpartition('.')[2], known)}"
    key = getattr(error.__cause__ or error, "full_key", None)
    return f"{key}: {_first_line(error)}" if key else _first_line(error)


def _known_keys() -> list[str]:
    """Every key at the top of a config, groups of files included."""
    keys = [key for key in field_keys(RunSettings) if "." not in key]
    return [*keys, "experiment", "subject", "scale"]


def _first_line(error: BaseException) -> str:
    """The first line of an error's message, or of its cause's."""
    if lines := str(error).strip().splitlines():
        return _short(lines[0])
    return _first_line(error.__cause__) if error.__cause__ else type(error).__name__


def _short(text: str) -> str:
    """A text that leaves room for others on the screen."""
    return text if len(text) <= 300 else f"{text[:200]} ... {text[-80:]}"


def _broken_file() -> str | None:
    """Which config file cannot be read, and where; None if all can."""
    named = [Path(word.rpartition("=")[2]) for word in sys.argv[1:]]  # by --config-dir
    folders = [CONF, *(folder for folder in named if os.path.isdir(folder))]
    for path in sorted(path for folder in folders for path in folder.rglob("*.yaml")):
        try:
            content = OmegaConf.load(path)
        except IsADirectoryError:
            return f"{path}: a folder, not a file"
        except UnicodeDecodeError as found:
            return f"{path}: byte {found.start} is not UTF-8; save the file as UTF-8"
        except yaml.YAMLError as found:
            mark = getattr(found, "problem_mark", None)
            line = f", line {mark.line + 1}" if mark else ""
            return f"{path}{line}: not valid YAML ({_first_line(found)})"
        except Exception as found:
            return f"{path}: cannot be read ({_first_line(found)})"
        if not OmegaConf.is_dict(content):
            return f"{path}: holds a list, not keys with values"
    return None
