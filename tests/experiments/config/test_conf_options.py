"""Every file of conf/ does what it is for; a new one is covered without touching a test."""

import functools
from typing import Any

import pytest
import yaml
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.types import RunMode
from omegaconf import OmegaConf

from experiments.app import version_base
from experiments.config.command_line import quote_options
from experiments.config.paths import CONF
from experiments.config.read import plain_tree, read_config, read_recorded_config
from experiments.sweep.combinations import Combinations
from experiments.sweep.composer import Composer
from experiments.sweep.plugins import register_plugins

register_plugins()

OPTIONS = {
    f"{path.parent.name}={path.stem}": path
    for path in sorted(CONF.glob("*/*.yaml"))
    if path.parent.name != "base"  # defaults, not options
}
# What the smoke scale may set: numbers of trials, the horizon, and the study that the tables go to.
SMALLER = {"study", "horizon", "rollouts", "demonstrations", "ranks"}
SMALLER |= {"next_task", "soft", "transfer", "resolution", "sampled", "models", "areas"}


@functools.cache  # each takes a tenth of a second
def composed(*words: str, config: str = "config") -> Any:
    """A config, Hydra's own part included."""
    with initialize_config_dir(str(CONF), **version_base()):
        return compose(config, [quote_options(word) for word in words], return_hydra_config=True)


def companions(option: str) -> list[str]:
    """The truth that a system or grid needs beside it, as the files of truths tell."""
    group, _, name = option.partition("=")
    if group in ("system", "grid"):
        for truth in sorted((CONF / "truth").glob("*.yaml")):
            word = f"truth={truth.stem}"
            if composed(word).hydra.runtime.choices[group] == name:
                return [word]
        return [word for word in _subject_of(group, name) if word != option] + ["truth=cell"]
    return []


def _subject_of(group: str, name: str) -> list[str]:
    """The system without a truth of its own that brings a grid, or is the one that is named."""
    for path in sorted((CONF / "system").glob("*.yaml")):
        word = f"system={path.stem}"
        if composed(word).hydra.runtime.choices[group] == name:
            return [word]
    return []


@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_makes_a_point_that_can_run(option: str) -> None:
    _, study = read_config(plain_tree(composed(option, *companions(option))))
    group, _, name = option.partition("=")
    if group == "experiment":
        assert study.study == name
    if option.startswith(("system=", "truth=", "grid=")):
        # What the file says is what the point gets.
        content = yaml.safe_load(OPTIONS[option].read_text())
        given = content.get(group, content)
        found = plain_tree(composed(option, *companions(option)))[group]
        assert {key: found[key] for key in given} == given


@pytest.mark.parametrize("option", [name for name in OPTIONS if name.startswith(("sy", "gr"))])
def test_every_option_suits_recorded_demonstrations(option: str) -> None:
    choices = composed(option, *companions(option)).hydra.runtime.choices
    words = dict.fromkeys([option, f"system={choices.system}", "demonstrations=x.csv"])
    read_recorded_config(plain_tree(composed(*words, config="infer")))


def test_every_group_is_in_the_defaults() -> None:
    chosen = composed().hydra.runtime.choices
    assert {option.partition("=")[0] for option in OPTIONS} <= set(chosen)


def test_smoke_scale_touches_no_axis_and_no_system() -> None:
    scale = OmegaConf.load(CONF / "scale" / "smoke.yaml")
    for experiment in (CONF / "experiment").glob("*.yaml"):
        swept = composed(f"experiment={experiment.stem}").hydra.sweeper.params
        for key in swept or ():
            assert OmegaConf.select(scale, str(key)) is None
    hydra = scale.pop("hydra")
    assert set(scale) <= SMALLER
    assert OmegaConf.to_container(hydra) == {"sweeper": {"ends": True}}


@pytest.mark.parametrize("experiment", [name for name in OPTIONS if name.startswith("experiment=")])
def test_every_experiment_is_valid_and_small_at_smoke_scale(experiment: str) -> None:
    """Each value and each case makes a point that can run; `make stress` plans all combinations."""
    words = [experiment, "scale=smoke"]
    with initialize_config_dir(str(CONF), **version_base()):
        loader = GlobalHydra.instance().config_loader()
        base = loader.load_configuration("config", words, RunMode.MULTIRUN)
        sweeper = base.hydra.sweeper
        combinations = Combinations(sweeper.params, sweeper.settings, sweeper.cases, sweeper.ends)
        points = combinations.overrides(words, OverridesParser.create())
        assert 1 <= len(points) <= 100
        composer, checked = Composer(loader, base), set[str]()
        for point in points:
            if not checked.issuperset(point):
                checked.update(point)
                read_config(composer.tree(point))
