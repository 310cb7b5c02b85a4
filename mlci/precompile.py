"""Compile all loops of the package at once, so that nobody waits later: python -m mlci.precompile

Without it each is compiled when it is first called, all of them in about ten seconds of one core.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module

from mlci.compiled import Compiled

# The modules that have such loops, those first that take longest.
MODULES = (
    "mlci.control.riccati",
    "mlci.safety.upwind",
    "mlci.safety.closest_approach",
    "mlci.recursions",
    "mlci.shapes.chords",
    "mlci.grids",
    "mlci.merged_moves",
    "mlci.control.ilqr",
)


def precompile(module: str) -> int:
    """Compile what a module has, unless that is on disk; returns how many functions these are."""
    found = [each for each in vars(import_module(module)).values() if isinstance(each, Compiled)]
    for function in found:
        function.machine_code()
    return len(found)


def main() -> None:
    """Compile the loops of all modules, a process for each core."""
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        print(f"compiled, or known from before: {sum(pool.map(precompile, MODULES))} functions")


if __name__ == "__main__":
    main()
