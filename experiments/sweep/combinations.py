"""The overrides that make each point of a sweep: swept values, values that go together, cases.

A study's file gives them under `hydra.sweeper`:

    params:                     # every combination of these values,
      truth: c1,c2
    settings:                   # with each of these lists of values that go together,
      - [dt=0.25, "grid=100,400,900"]
      - [dt=0.5, grid=400]
    cases:                      # and in each of them every case; names go to the table of cases
      default: []
      "temperature: 2": [temperature=2.0]
      "one more cell":          # a list of lists stands for this case in settings of its own
        - [dt=0.25, "grid.shape=[10,11]"]
        - ["dt=0.25,0.5", "grid.shape=[20,21]"]

Each part may be left out. Where an override has several values, so has its list.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from decimal import Decimal
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, RangeSweep
from hydra.errors import HydraException
from omegaconf import OmegaConf

from experiments.config.command_line import quote_options
from experiments.config.read import ConfigError
from experiments.config.settings import SweepSettings

_NOT_SWEPT = {
    "scale": "a sweep has one scale; run it once for each",
    "experiment": "a sweep over experiments would drop the values that each of them sweeps; "
    "run them one after the other",
    **dict.fromkeys(
        ("study", "results", "workers", *(f"sweep.{f.name}" for f in fields(SweepSettings))),
        "this changes no result, so give it one value only",
    ),
}
_LISTED = 10  # values that a note tells one by one


@dataclass(frozen=True)
class Case:
    """Overrides that go together.

    Attributes:
        place: where the study's file has them, for messages.
        overrides: as they are written there; one may have several values.
    """

    place: str
    overrides: tuple[str, ...]


@dataclass
class Combinations:
    """What a study's file says; what is wrong with it is raised by `overrides`.

    Attributes:
        params: values that are swept, by key: "1,2,3"; None for no key.
        settings: lists of overrides; None for a single one without any.
        cases: names with overrides; None for a single one without a name.
        ends: of several values take the first and the last only, of seeds the first, and note that.
        notes: what a reader has to know of the combinations, once they are listed.
    """

    params: Mapping[str, str] | None = None
    settings: object = None
    cases: object = None
    ends: bool = False
    notes: list[str] = field(default_factory=list)

    def overrides(self, arguments: Sequence[str], parser: OverridesParser) -> list[list[str]]:
        """The overrides of every point, in order.

        Args:
            arguments: overrides of the command line, which win over the study's own.
            parser: reads overrides.

        Raises:
            ConfigError: something cannot be read, or cannot be swept.
        """
        cases = read_cases(self._study_settings(), self.cases)
        typed = parser.parse_overrides(list(arguments))
        typed_keys = {override.key_or_group for override in typed}
        values: dict[str, list[str]] = {}
        if not isinstance(self.params or {}, Mapping):
            raise ConfigError(f"hydra.sweeper.params: {self.params} is no mapping of keys")
        swept = [quote_options(f"{key}={value}") for key, value in (self.params or {}).items()]
        for override in parser.parse_overrides(swept):
            _values(override)  # what cannot be swept is refused even where the command line wins
            if override.key_or_group not in typed_keys:
                values[override.get_key_element()] = self._study_values(override)
        for override in typed:
            values[override.get_key_element()] = _values(override)
        combinations = [
            overrides
            for case in cases
            for overrides in self._combinations_of(case, parser, typed_keys)
        ]
        self.notes = list(dict.fromkeys(self.notes))
        return [
            [*job, *overrides]
            for job in itertools.product(*values.values())
            for overrides in combinations
        ]

    def _study_settings(self) -> object:
        """The study's settings; the first and the last, if each has a system and ends are taken."""
        lists = _plain(self.settings)
        if not (self.ends and isinstance(lists, list) and len(lists) > 2):
            return self.settings
        if not all(any(str(word).startswith("system=") for word in words) for words in lists):
            return self.settings
        self.notes.append(f"settings: the first and the last stand for all {len(lists)} systems")
        return [lists[0], lists[-1]]

    def _combinations_of(
        self, case: Case, parser: OverridesParser, typed_keys: set[str]
    ) -> Iterator[tuple[str, ...]]:
        """The combinations of a case's values, without the keys that the command line gives."""
        swept_keys = {key.lstrip("+~") for key in self.params or ()}
        values: dict[str, list[str]] = {}
        for word in case.overrides:
            place = f"{case.place}: {word}"
            try:
                override = parser.parse_override(quote_options(word))
            except HydraException:
                raise ConfigError(f"{place} cannot be read as key=value") from None
            key = override.key_or_group
            if key in _NOT_SWEPT:
                raise ConfigError(f"{place}: {_NOT_SWEPT[key]}")
            if key in values:
                raise ConfigError(
                    f"{place} is the second value of {key} in this case; keep one, or give the "
                    "case settings of its own, as a list of lists"
                )
            if key in swept_keys:
                raise ConfigError(f"{place}: params sweep {key} too; leave it to one of them")
            values[key] = [] if key in typed_keys else self._study_values(override)
        return itertools.product(*(each for key, each in values.items() if key not in typed_keys))

    def _study_values(self, override: Override) -> list[str]:
        """What a study gives a key, or the ends of it; notes what the ends stand for."""
        values, key = _values(override), override.get_key_element()
        ends = [0] if key == "seed" else [0, -1]  # a seed stands for any other
        if not self.ends or len(values) <= len(ends):
            return values
        texts = swept_texts(override)
        shown, stand = " and ".join(texts[i] for i in ends), "stands" if len(ends) == 1 else "stand"
        few = texts if len(texts) <= _LISTED else [*texts[:3], "...", texts[-1]]
        self.notes.append(f"{key}: {shown} {stand} for all of {', '.join(few)}")
        return [values[i] for i in ends]


def read_cases(settings: object, cases: object) -> list[Case]:
    """Every case in each of the settings.

    Args:
        settings: lists of overrides; None for a single one without any.
        cases: names with overrides; None for a single one without a name.

    Raises:
        ConfigError: something else.
    """
    place = "hydra.sweeper.cases"
    shared = _read_lists("hydra.sweeper.settings", _plain(settings) or [[]])
    cases = _plain(cases)
    if not cases:
        return shared
    if not isinstance(cases, dict):
        raise ConfigError(f"{place}: {cases!r} does not name its cases, as {{default: []}} does")
    read = []
    for name, content in cases.items():
        if isinstance(content, list) and content and isinstance(content[0], list):
            variants = [each.overrides for each in _read_lists(f"{place}.{name}", content)]
        else:
            words = _read_list(f"{place}.{name}", content).overrides
            variants = [(*each.overrides, *words) for each in shared]
        quote = '"' if "'" in str(name) else "'"
        named = f"case={quote}{name}{quote}"
        read += [Case(f"{place}.{name}", (named, *words)) for words in variants]
    return read


def _plain(value: object) -> Any:
    """A config as plain lists and dicts."""
    return OmegaConf.to_container(value) if OmegaConf.is_config(value) else value


def _read_lists(place: str, lists: object) -> list[Case]:
    """Lists of overrides, each with its place."""
    if not isinstance(lists, list):
        raise ConfigError(f"{place}: {lists!r} is no list of lists of overrides")
    return [_read_list(f"{place}[{i}]", words) for i, words in enumerate(lists)]


def _read_list(place: str, words: object) -> Case:
    """A list of overrides."""
    if not (isinstance(words, list) and all(isinstance(word, str) for word in words)):
        message = f"{words!r} is no list of overrides, such as [dt=0.5, seed=1]"
        raise ConfigError(f"{place}: {message}")
    return Case(place, tuple(words))


def _values(override: Override) -> list[str]:
    """The overrides that one with several values stands for."""
    key, name = override.get_key_element(), override.key_or_group
    if not override.is_sweep_override():
        return [f"{key}={override.get_value_element_as_str()}"]
    if name in _NOT_SWEPT:
        raise ConfigError(f"{override.input_line}: {_NOT_SWEPT[name]}")
    if not override.is_discrete_sweep():
        raise ConfigError(f"{override.input_line}: cannot be swept; list its values")
    values = [quote_options(f"{key}={value}") for value in swept_texts(override)]
    if not values:
        raise ConfigError(f"{override.input_line}: there is no value to sweep")
    return values


def swept_texts(override: Override) -> list[str]:
    """The values of a discrete sweep, as text; those of a range are the decimals that it counts."""
    spans = override.value()
    if not isinstance(spans, RangeSweep) or isinstance(spans.range(), range):
        return list(override.sweep_string_iterator())
    start, stop, step = (Decimal(repr(end)) for end in (spans.start, spans.stop, spans.step))
    count = max(0, math.ceil((stop - start) / step)) if step else 0
    texts = [repr(float(start + i * step)) for i in range(count)]
    if spans.shuffle:
        random.shuffle(texts)
    return texts
