"""Which module may import which: tables to read, and the checks that hold the code to them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("mlci", "experiments", "paper_figures")

# A module of mlci, and what stands directly below it. It may import that, and all that is below
# that. A package's name stands for its modules, which may import each other.
MLCI = {
    "mlci.actuation": "",
    "mlci.areas": "",
    "mlci.control": "",
    "mlci.mechanics": "",
    "mlci.rivals": "",
    "mlci.safety": "",
    "mlci.sampled": "",
    "mlci.sets": "",
    "mlci.shapes": "",
    "mlci.soft": "",
    "mlci.worlds": "",
    "mlci.compiled": "",
    "mlci.precompile": "mlci.compiled",  # and by name those that it compiles
    "mlci.spaces": "",
    "mlci.grids": "mlci.compiled mlci.spaces",
    "mlci.cells": "",
    "mlci.cells.protocol": "mlci.spaces",
    "mlci.cells.box_tree": "mlci.spaces",
    "mlci.cells.goal_cells": "mlci.cells.box_tree mlci.grids",
    "mlci.shapes.chords": "mlci.compiled mlci.spaces",
    "mlci.shapes.images": "mlci.spaces",
    "mlci.shapes.spans": "mlci.spaces",
    "mlci.shapes.shape": "mlci.shapes.chords mlci.shapes.images mlci.shapes.spans",
    "mlci.shapes.balls": "mlci.shapes.shape",
    "mlci.shapes.half_spaces": "mlci.shapes.shape",
    "mlci.shapes.predicates": "mlci.shapes.shape",
    "mlci.shapes.membership": "mlci.shapes.shape",
    "mlci.shapes.box_relations": "mlci.spaces",
    "mlci.regions": "mlci.shapes.box_relations mlci.grids mlci.shapes.membership",
    "mlci.crossings": "mlci.regions",
    "mlci.differences": "mlci.spaces",
    "mlci.systems": "mlci.differences",
    "mlci.wrapped": "mlci.systems",
    "mlci.json_numbers": "",
    "mlci.system_check": "mlci.systems",
    "mlci.control.effort": "mlci.wrapped",
    "mlci.strength": "mlci.wrapped",
    "mlci.simulate": "mlci.systems",
    "mlci.safety.upwind": "mlci.compiled mlci.grids",
    "mlci.safety.reachability": "mlci.regions mlci.system_check mlci.safety.upwind",
    "mlci.safety.closest_approach": "mlci.compiled mlci.regions",
    "mlci.safety.constant_controls": "mlci.safety.closest_approach mlci.safety.reachability "
    "mlci.simulate",
    "mlci.control.control_problem": "mlci.simulate",
    "mlci.safety.safety_filter": "mlci.control.control_problem mlci.safety.reachability",
    "mlci.mechanics.rigid_chain": "mlci.spaces",
    "mlci.mechanics.planar_chain": "mlci.mechanics.rigid_chain mlci.systems",
    "mlci.safety.joint_barrier": "mlci.control.control_problem mlci.mechanics.planar_chain "
    "mlci.regions",
    "mlci.control.riccati": "mlci.compiled mlci.control.control_problem",
    "mlci.control.ilqr": "mlci.control.riccati",
    "mlci.demonstrations": "mlci.spaces",
    "mlci.demonstrator": "mlci.demonstrations mlci.control.ilqr "
    "mlci.safety.safety_filter mlci.simulate",
    "mlci.recordings": "mlci.crossings mlci.demonstrations mlci.systems mlci.worlds.tables",
    "mlci.planes": "mlci.regions",
    "mlci.outlines": "mlci.planes",
    "mlci.single_moves": "mlci.spaces",
    "mlci.merged_moves": "mlci.compiled mlci.single_moves",
    "mlci.paths": "mlci.cells.protocol mlci.regions mlci.systems",
    "mlci.explored": "mlci.spaces",
    "mlci.tabular": "mlci.explored mlci.merged_moves mlci.paths mlci.simulate",
    "mlci.worlds.flows": "mlci.spaces",
    "mlci.worlds.transitions": "mlci.spaces",
    "mlci.worlds.tables": "mlci.regions mlci.worlds.transitions",
    "mlci.worlds.first_exit": "mlci.worlds.flows mlci.worlds.tables",
    "mlci.worlds.causal_entropy": "mlci.worlds.flows mlci.worlds.tables",
    "mlci.joint_avoidance": "mlci.recursions",
    "mlci.worlds.fixed_horizon": "mlci.joint_avoidance mlci.worlds.tables",
    "mlci.best_areas": "mlci.evidence",
    "mlci.zoo": "mlci.systems",
    "mlci.outlook": "",
    "mlci.outlook.rule": "mlci.spaces",
    "mlci.outlook.flow": "mlci.demonstrations mlci.grids mlci.systems",
    "mlci.outlook.detours": "mlci.maxent",
    "mlci.outlook.outlook": "mlci.diagnosis mlci.maxent mlci.outlook.detours "
    "mlci.outlook.flow mlci.preparation",
    "mlci.sets.chains": "mlci.spaces",
    "mlci.sets.evidence": "mlci.inference mlci.models",
    "mlci.sets.posterior": "mlci.sets.chains mlci.sets.evidence",
    "mlci.sets.sampling": "mlci.sets.posterior",
    "mlci.sets.inference": "mlci.sets.sampling",
    "mlci.sets.search": "mlci.evidence",
    "mlci.sets.selection": "mlci.worlds.first_exit mlci.worlds.fixed_horizon "
    "mlci.sets.search mlci.sets.posterior",
    "mlci.worlds.inference": "mlci.worlds.causal_entropy mlci.evidence "
    "mlci.worlds.first_exit mlci.worlds.fixed_horizon",
    "mlci.baselines": "mlci.misfit",
    "mlci.areas.prior_shapes": "mlci.regions mlci.shapes.balls",
    "mlci.areas.overlap": "mlci.spaces",
    "mlci.areas.evidence": "mlci.misfit mlci.evidence",
    "mlci.areas.belief": "mlci.areas.evidence mlci.areas.overlap mlci.credible_sets",
    "mlci.areas.next_task": "mlci.areas.belief mlci.task_outcomes",
    "mlci.rivals.agent": "mlci.worlds.tables",
    "mlci.rivals.problem": "mlci.rivals.agent",
    "mlci.rivals.set_gains": "mlci.rivals.problem mlci.sets.evidence",
    "mlci.rivals.traces": "mlci.rivals.problem",
    "mlci.rivals.penalty_map": "mlci.rivals.problem",
    "mlci.rivals.printed": "mlci.rivals.problem mlci.worlds.fixed_horizon",
    "mlci.diagnosis": "mlci.tabular",
    "mlci.end_moves": "mlci.tabular",
    "mlci.recursions": "mlci.compiled mlci.tabular",
    "mlci.maxent": "mlci.end_moves mlci.joint_avoidance mlci.demonstrations",
    "mlci.cells.multilinear": "mlci.tabular",
    "mlci.cells.importance": "mlci.cells.box_tree mlci.maxent",
    "mlci.cells.refinement": "mlci.cells.goal_cells mlci.cells.importance",
    "mlci.cells.refined_model": "mlci.cells.refinement",
    "mlci.displacements": "mlci.tabular",
    "mlci.exploration": "mlci.displacements mlci.maxent",
    "mlci.evidence": "mlci.spaces",
    "mlci.region_sizes": "mlci.regions",
    "mlci.forecasts": "mlci.region_sizes",
    "mlci.forecast_scores": "mlci.forecasts",
    "mlci.likelihood_interval": "mlci.spaces",
    "mlci.rule_breaking": "mlci.evidence mlci.likelihood_interval",
    "mlci.sampling_errors": "mlci.spaces",
    "mlci.inference": "mlci.crossings mlci.forecasts mlci.rule_breaking mlci.credible_sets "
    "mlci.demonstrations mlci.sampling_errors",
    "mlci.plot": "mlci.inference mlci.outlines",
    "mlci.sampled.passage": "mlci.control.control_problem",
    "mlci.sampled.modes": "mlci.demonstrator mlci.sampled.passage mlci.wrapped",
    "mlci.sampled.truncated_normal": "mlci.spaces",
    "mlci.sampled.local_policies": "mlci.sampled.modes mlci.sampled.truncated_normal",
    "mlci.sampled.weights": "mlci.sampling_errors",
    "mlci.sampled.proposals": "mlci.sampled.local_policies",
    "mlci.sampled.detours": "mlci.sampled.proposals",
    "mlci.sampled.adaptation": "mlci.sampled.detours mlci.sampled.weights",
    "mlci.sampled.diagnosis": "mlci.spaces",
    "mlci.sampled.model_check": "mlci.systems",
    "mlci.sampled.distribution": "mlci.sampled.adaptation mlci.sampled.diagnosis",
    "mlci.sampled.model": "mlci.sampled.distribution mlci.sampled.model_check",
    "mlci.sampled.rare_regions": "mlci.sampled.distribution",
    "mlci.models": "mlci.cells.refined_model mlci.evidence mlci.maxent "
    "mlci.sampled.model mlci.sampling_errors",
    "mlci.preparation": "mlci.inference mlci.models",
    "mlci.rank_errors": "mlci.json_numbers mlci.preparation",
    "mlci.similar_tasks": "mlci.demonstrator mlci.models",
    "mlci.calibration": "mlci.forecast_scores mlci.misfit mlci.similar_tasks mlci.preparation",
    "mlci.inverse_dynamics": "mlci.demonstrations mlci.simulate",
    "mlci.actuation.hypotheses": "mlci.inverse_dynamics",
    "mlci.actuation.ranges": "mlci.actuation.hypotheses",
    "mlci.actuation.predicates": "mlci.actuation.hypotheses",
    "mlci.actuation.moves": "mlci.actuation.hypotheses mlci.maxent",
    "mlci.actuation.inference": "mlci.actuation.moves mlci.evidence mlci.forecasts",
    "mlci.actuation.joint": "mlci.actuation.inference mlci.inference",
    "mlci.actuation.limited": "mlci.wrapped",
    "mlci.temperature": "mlci.inference mlci.inverse_dynamics mlci.maxent",
    "mlci.soft.time_inside": "mlci.crossings mlci.tabular",
    "mlci.ties": "mlci.inference mlci.tabular",
    "mlci.soft.distribution": "mlci.maxent mlci.soft.time_inside",
    "mlci.soft.weight": "mlci.inference mlci.soft.distribution",
    "mlci.credible_sets": "mlci.evidence mlci.regions",
    "mlci.size_bias": "mlci.inference mlci.json_numbers",
    "mlci.support": "mlci.inference",
    "mlci.misfit": "mlci.models",
    "mlci.answers": "mlci.next_task mlci.rank_errors mlci.size_bias mlci.soft.weight mlci.support "
    "mlci.temperature mlci.ties",
    "mlci.metrics": "mlci.evidence",
    "mlci.task_outcomes": "mlci.evidence",
    "mlci.next_task": "mlci.calibration mlci.json_numbers mlci.misfit mlci.models "
    "mlci.task_outcomes",
}
# What mlci may import of others: no configs, no formats but those of recordings, no figures.
MATHEMATICS = "contourpy numpy scipy numba pandas pyarrow joblib pint openpyxl ezc3d"

# A room of the framework, and all that it may import of this project.
TRACKING, POINT = (
    "experiments.tracking",
    ("mlci experiments.config experiments.tracking experiments.progress"),
)
EVERYTHING = " ".join(PACKAGES)
ROOMS = {
    "experiments.progress": "",
    TRACKING: "experiments.progress",
    "experiments.config.paths": TRACKING,
    "experiments.config.suggestions": "",
    "experiments.config": f"mlci {TRACKING} experiments.terminal",
    "experiments.terminal": "",
    "experiments.console": "mlci experiments.terminal",
    "experiments.belief_lines": "mlci experiments.console experiments.terminal",
    "experiments.point": f"{POINT} experiments.console experiments.terminal "
    "experiments.belief_lines",
    "experiments.collate": f"{TRACKING} experiments.terminal",
    "experiments.collate.success_rule": "mlci.outlook experiments.collate",
    "experiments.sweep": f"{POINT} experiments.terminal experiments.point experiments.collate",
    "experiments.lookback": f"mlci {TRACKING} experiments.collate experiments.config.paths "
    "experiments.config.suggestions experiments.terminal",
    "experiments.field": f"mlci {TRACKING} experiments.config.paths",
    "experiments.page": "mlci experiments.belief_lines experiments.console experiments.terminal",
    "experiments.page.of_point": f"{POINT} experiments.console experiments.point experiments.page "
    "experiments.lookback",
    "paper_figures": f"mlci.regions {TRACKING} experiments.config.paths",
    # The door: the commands, and what they share.
    "experiments.app": EVERYTHING,
    "experiments.run": EVERYTHING,
    "experiments.infer": EVERYTHING,
    "experiments.infer_table": EVERYTHING,
    "experiments.advise": EVERYTHING,
    "experiments.success_rule": EVERYTHING,
    "experiments.results": EVERYTHING,
}

LONGEST = 300  # lines of a module
NAMES_THAT_SAY_NOTHING = {"common", "helpers", "misc", "util", "utils"}

Graph = Mapping[str, set[str]]


def import_graph(*packages: str) -> dict[str, set[str]]:
    """Every module of some packages, with all modules that it imports, at any depth of its code."""
    graph = grimp.build_graph(*packages, include_external_packages=True, cache_dir=None)
    own = [name for name in graph.modules if name.split(".")[0] in packages]
    return {name: set(graph.find_modules_directly_imported_by(name)) for name in sorted(own)}


def is_of(module: str, entries: Iterable[str]) -> bool:
    """Whether a module is one of the entries, or inside one of them."""
    return any(module == entry or module.startswith(f"{entry}.") for entry in entries)


def entry_of(module: str, table: Mapping[str, str]) -> str | None:
    """The entry of a table that a module belongs to: the most special one."""
    return max((entry for entry in table if is_of(module, [entry])), key=len, default=None)


def with_all_below(table: Mapping[str, str]) -> dict[str, str]:
    """The same table with everything that is below, not only what stands directly below."""
    below: dict[str, set[str]] = {}
    for entry in TopologicalSorter(
        {name: line.split() for name, line in table.items()}
    ).static_order():
        directly = table[entry].split()
        below[entry] = set(directly).union(*(below[name] for name in directly))
    return {entry: " ".join(sorted(names)) for entry, names in below.items()}


def violations(graph: Graph, table: Mapping[str, str]) -> list[str]:
    """The imports between modules of the graph that a table does not allow, a line each."""
    lines = []
    for module, imports in graph.items():
        entry = entry_of(module, table)
        for imported in sorted(imports & graph.keys()):
            if entry is not None and not is_of(imported, [entry, *table[entry].split()]):
                lines.append(f"{module} imports {imported}")
    return lines


def circle(graph: Graph) -> list[str]:
    """Modules of which each imports the one before and the first the last, or nothing."""
    try:
        TopologicalSorter({name: graph[name] & graph.keys() for name in graph}).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


@pytest.fixture(scope="module")
def graph() -> dict[str, set[str]]:
    return import_graph(*PACKAGES)


def test_a_violation_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a house of two floors with a cellar, whose modules import each other in every manner."""
    sources = {
        "house/__init__.py": "",
        "house/cellar.py": "import json",
        "house/ground/__init__.py": "from house import cellar",
        "house/ground/hall.py": "def up():\n    from house.attic import box",
        "house/ground/kitchen.py": "import house.ground.hall",
        "house/attic.py": "from house.ground.kitchen import sink\nimport house.cellar",
    }
    for name, source in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    graph = import_graph("house")
    assert graph["house.cellar"] == {"json"}
    stairs = {"house.cellar": "", "house.ground": "house.cellar", "house.attic": "house.ground"}
    upward = "house.ground.hall imports house.attic"
    assert violations(graph, with_all_below(stairs)) == [upward]
    assert violations(graph, stairs) == ["house.attic imports house.cellar", upward]
    # A module with an entry of its own is judged by that, not by its package's.
    assert violations(graph, {**stairs, "house.ground.kitchen": ""}) == [
        *("house.attic imports house.cellar", upward),
        "house.ground.kitchen imports house.ground.hall",
    ]
    assert set(circle(graph)) == {"house.attic", "house.ground.hall", "house.ground.kitchen"}
    assert not circle({**graph, "house.ground.hall": set()})


def test_every_module_has_its_place(graph: Graph) -> None:
    """A new module of mlci, and a new room, gets a line in a table above."""
    packages = {"mlci", "experiments"}  # their __init__ may import anything below or nothing
    placed = [module for module in graph if entry_of(module, {**MLCI, **ROOMS})]
    assert graph.keys() - placed == packages


def test_modules_of_mlci_import_those_below(graph: Graph) -> None:
    assert violations(graph, with_all_below(MLCI)) == []


def test_mlci_is_mathematics_alone(graph: Graph) -> None:
    allowed = {"mlci", *MATHEMATICS.split(), *sys.stdlib_module_names}
    for module, imports in graph.items():
        if is_of(module, ["mlci"]):
            pictures = {"matplotlib"} if module == "mlci.plot" else set()
            assert {name.split(".")[0] for name in imports} <= allowed | pictures, module


def test_mlci_loads_late_what_takes_time_and_not_every_use_needs() -> None:
    late = {"pandas", "numba", "joblib", "matplotlib", "html"}
    late |= {f"scipy.{part}" for part in ("interpolate", "linalg", "optimize", "sparse", "special")}
    code = f"import sys, mlci, mlci.temperature; print(*sys.modules.keys() & {late!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_rooms_import_those_below(graph: Graph) -> None:
    assert violations(graph, ROOMS) == []


def test_nothing_imports_in_a_circle(graph: Graph) -> None:
    assert circle(graph) == []


def test_modules_are_short_and_named_for_what_is_inside(graph: Graph) -> None:
    paths = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    assert len(paths) == len(graph)
    long = {
        path.relative_to(ROOT).as_posix()
        for path in paths
        if len(path.read_text().splitlines()) > LONGEST
    }
    assert not long
    assert not [path for path in paths if path.stem in NAMES_THAT_SAY_NOTHING]
