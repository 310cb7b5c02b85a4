"""Who may import whom: the README's walk is the order of the layers."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SPACES = {"spaces"}
SETS = SPACES | {"grids", "constraints"}
MOTION = SPACES | {"systems", "simulate"}
TABULAR = SETS | MOTION | {"ways", "mdp", "maxent"}

# A module of mlci to the modules of mlci that it may import.
MAY_IMPORT = {
    "__init__": set(),
    "spaces": set(),
    "grids": SPACES,
    "constraints": SETS,
    "systems": SPACES,
    "soundness": SPACES | {"systems"},
    "simulate": MOTION,
    "reachability": SETS | MOTION,
    "escapes": SETS | MOTION | {"reachability"},
    "safety_filter": SETS | MOTION | {"reachability"},
    "ilqr": MOTION,
    "demonstrations": SPACES,
    "demonstrator": SETS | MOTION | {"reachability", "ilqr", "demonstrations"},
    "recording_formats": MOTION,
    "recordings": MOTION | {"demonstrations", "recording_formats"},
    "ways": SPACES,
    "mdp": SETS | MOTION | {"ways"},
    "maxent": TABULAR,
    "inference": TABULAR,
    "online": TABULAR | {"inference"},
    "metrics": TABULAR | {"inference"},
}
MATHEMATICS = {"numpy", "scipy", "pyarrow", "mlci"}


def imports(source: str) -> Iterator[str]:
    """Dotted names that a module's source imports, at any depth; `from a import b` gives a.b."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def test_every_kind_of_import_is_seen():
    source = "import a.b, c\nfrom d.e import f as g\ndef h():\n    from i import j, k\n"
    assert list(imports(source)) == ["a.b", "c", "d.e.f", "i.j", "i.k"]


@pytest.mark.parametrize("path", modules("mlci"), ids=lambda path: path.stem)
def test_mlci_knows_only_mathematics_and_the_layers_below(path):
    names = [name.split(".") for name in imports(path.read_text())]
    outside = {name[0] for name in names} - MATHEMATICS - sys.stdlib_module_names
    assert not outside
    assert path.stem in MAY_IMPORT, "a new module needs its place among the layers"
    inside = {name[1] for name in names if name[0] == "mlci" and len(name) > 1}
    assert inside <= MAY_IMPORT[path.stem]


def test_figures_and_report_read_results_and_run_nothing():
    for path in modules("paper_figures") + modules("paper_report"):
        roots = {name.split(".")[0] for name in imports(path.read_text())}
        assert not roots & {"experiments", "mlci", "hydra", "omegaconf"}, path
