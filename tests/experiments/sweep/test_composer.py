"""A sweep's configs are those that Hydra composes, each choice of groups composed once."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hydra import initialize_config_dir
from hydra.core.config_loader import ConfigLoader
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig

from experiments.app import version_base
from experiments.config.paths import CONF
from experiments.config.read import ConfigError, plain_tree
from experiments.sweep.composer import Composer
from experiments.sweep.plugins import register_plugins


class Counting:
    """Hydra's loader, and how often it composed."""

    def __init__(self, loader: ConfigLoader) -> None:
        self.loader, self.composed = loader, 0

    def load_sweep_config(self, base: DictConfig, job: list[str]) -> DictConfig:
        self.composed += 1
        return self.loader.load_sweep_config(base, job)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.loader, name)


@pytest.fixture
def loader() -> Iterator[Counting]:
    register_plugins()
    with initialize_config_dir(str(CONF), **version_base()):
        yield Counting(GlobalHydra.instance().config_loader())


def composer(loader: Counting, *words: str) -> tuple[Composer, DictConfig]:
    """A composer of a sweep with some words on its command line, and the config of that."""
    base = loader.load_configuration("config", list(words), RunMode.MULTIRUN)
    return Composer(loader, base), base


def test_configs_are_those_of_hydra_and_groups_are_composed_once(loader: Counting) -> None:
    compose, base = composer(loader, "hydra.job.name=other")
    jobs = [
        [f"truth={truth}", f"dt={dt}", *more]
        for truth in ("c1", "cell")
        for dt in (0.5, 1)
        for more in (
            ["grid='100'", "grid.shape=[3,4]"],  # a value of a group that is chosen too
            ["grid='100'", "case='a, b: c'", "actions=5"],
            ["dt=${horizon}", "tasks.lower=[null,-4.0]", "truth.boxes=[]", "grid='100'"],
            ["reality.system={length: 0.6}", "grid='100'"],
        )
    ]
    trees = [compose.tree(job) for job in jobs]
    assert loader.composed == 2
    assert trees == [plain_tree(loader.load_sweep_config(base, job)) for job in jobs]
    assert trees[2]["dt"] == trees[2]["horizon"]


def test_what_a_file_refers_to_is_followed(loader: Counting, tmp_path: Path) -> None:
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "mine.yaml").write_text("# @package _global_\nrollouts: ${misfit}\n")
    compose, base = composer(loader, f"hydra.searchpath=[{tmp_path}]")
    for job in (["truth=mine", "misfit=3"], ["truth=mine", "dt=0.5", "misfit=4"]):
        assert compose.tree(job) == plain_tree(loader.load_sweep_config(base, job))
    assert compose.tree(["truth=mine", "misfit=3"])["rollouts"] == 3


def test_points_share_no_part_of_a_config_that_one_could_change(loader: Counting) -> None:
    compose, _ = composer(loader)
    compose.tree(["dt=0.5"])["tasks"]["lower"] = "changed"
    assert compose.tree(["dt=0.25"])["tasks"]["lower"] != "changed"


@pytest.mark.parametrize("word", ["+note=1", "~safety.width", "hydra.job.name=third"])
def test_what_does_more_than_change_a_value_is_left_to_hydra(loader: Counting, word: str) -> None:
    compose, base = composer(loader)
    job = ["dt=0.5", word]
    assert compose.tree(job) == plain_tree(loader.load_sweep_config(base, job))


def test_what_hydra_refuses_is_refused_in_its_words(loader: Counting) -> None:
    compose, base = composer(loader)
    for job in (["dtt=1"], ["truth=no_such"], ["safety.width.more=1"]):
        with pytest.raises(HydraException) as hydra:
            loader.load_sweep_config(base, job)
        with pytest.raises(type(hydra.value)) as ours:
            compose.tree(job)
        assert str(ours.value) == str(hydra.value)
    with pytest.raises(ConfigError, match="no_such"):
        compose.tree(["dt=${no_such}"])
