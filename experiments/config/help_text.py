"""What the commands say to --help, made from their options; `reference` writes it to conf/help."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from experiments.terminal import WIDTH

_KEYS = 26  # columns of keys in the texts of --help
_PURPOSE = {
    "config": """\
Run one point, or with -m a sweep of every combination of the listed values.
What is done already is not run again: the same command runs what is missing.

  python experiments/run.py truth=c2 grid.shape=[12,15] dt=0.5
  python experiments/run.py -m truth=c1,c2 grid=100,400 dt=0.2,0.25
  python experiments/run.py -m experiment=paper sweep.dry_run=true""",
    "infer": """\
Rank constraints from recorded demonstrations: which region did they avoid?
One file a demonstration: a table with columns for time and each state.

  python experiments/infer.py demonstrations=recorded
  python experiments/infer.py demonstrations='recorded/*.csv' dt=0.5
  python experiments/infer.py demonstrations=recorded system=double_integrator

A finite world is given as a file: table=world.yaml --help tells its options.""",
    "infer_table": """\
Rank constraints of a finite world from paths through it: which states, actions
or sets of them did they avoid? One file a path, or a column trial: a row a
step, with columns state and action.

  python experiments/infer.py table=world.yaml demonstrations=paths
  python experiments/infer.py table=world.yaml demonstrations='paths/*.csv'
  python experiments/infer.py table=world.yaml demonstrations=path.csv least=0.5

world.yaml names the moves, start, goals and hypotheses; experiments/README.md
describes it.""",
    "advise": """\
Compare discretisations of a system, and recommend one. Needs neither a truth
nor demonstrations.

  python experiments/advise.py
  python experiments/advise.py system=double_integrator horizon=4
  python experiments/advise.py grids=[[10,10],[20,20]] dts=[0.25,0.5]""",
}
_ENDING = """\
A region is {lower: [...], upper: [...]}, with a number for each dimension, or
null where it is free: 'goal={lower: [3.1, -0.1], upper: [3.2, 0.1]}'. Durations
are in seconds. A number may be a multiple of pi: "6/5 pi".

  --help, --version         this text; the version of mlci
  --cfg job                 print the composed config, and run nothing

Exit status: 0 all is done, 1 something failed, 2 the config is wrong, 130 after
Ctrl-C. conf/README.md has all options in a table, with their ranges."""


@dataclass(frozen=True)
class Option:
    """A value that a command takes, in words."""

    key: str
    meaning: str
    unit: str
    default: str
    values: str


def help_text(command: str, own: Sequence[Option], shared: Sequence[Option]) -> str:
    """What a command does, examples, and its options.

    Args:
        command: its file in conf/, without the suffix.
        own: options that no command before it has.
        shared: the others.
    """
    lines = [*_PURPOSE[command].splitlines(), "", "Options, as KEY=VALUE", ""]
    lines += [line for option in own for line in _lines(option)]
    if shared:
        lines += ["", "Options that run.py has too", ""]
        lines += [line for option in shared for line in _lines(option)]
    return "\n".join([*lines, "", *_ENDING.splitlines()]) + "\n"


def _lines(option: Option) -> list[str]:
    """An option: key, meaning, unit, choices, and default."""
    unit = f" [{option.unit}]" * bool(option.unit)
    choices = f": {option.values}" * ("`" in option.values)
    default = option.default if option.default == "to be given" else f"default {option.default}"
    if option.default.startswith("by "):
        default = f"set {option.default}"
    text = f"{option.meaning}{unit}{choices} ({default})".replace("`", "")
    key, indent = f"  {option.key}", " " * _KEYS
    lines = textwrap.wrap(
        text,
        WIDTH,
        initial_indent=indent,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    if len(key) + 2 > _KEYS:
        return [key, *lines]
    return [key + lines[0][len(key) :], *lines[1:]]
