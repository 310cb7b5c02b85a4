"""How much memory a point takes at most, told before anything is computed."""

from __future__ import annotations

import math
import os

from experiments.config.settings import ModelSettings, Settings
from mlci.recursions import ALPHA_BYTES
from mlci.tabular import moves_are_kept

# Measured on points of 0.4 to 4 million moves, and `python -m tests.benchmark` compares: a move has
# successor, reward, its place among the cell's successors and the regions that it crosses, and most
# of these twice while what is read from the store is joined.
_BYTES_A_MOVE = 100
# A larger model keeps merged moves alone, of which a cell has about three an action, however many
# start points it has: successor, weight, the regions that it crosses, and one of these twice.
_MERGED_AN_ACTION, _BYTES_A_MERGED_MOVE = 4, 50
_BYTES_A_STEP = 16  # and cell: log Z, and which cells can be occupied
_BYTES_A_HYPOTHESIS = 30_000  # while crossings are found
_COPIES_OF_PATHS, _COPIES_OF_CROSSINGS = 6, 3  # of sampled paths, at most, while they are weighed
# Of a first guess and step: paths, their derivatives, gains, and candidates of the line search;
# measured with 2 and 4 states and half as many controls.
_NUMBERS_A_DIMENSION = 22
RESOLUTION_SAMPLES = 2  # start points along each dimension of a cell, where kinds are compared
_BYTES_AT_REST = 200_000_000  # the interpreter, its packages, and blocks of work


def expected_memory(settings: ModelSettings) -> float:
    """Bytes that a point takes at most for its model and the inference."""
    if settings.sampling is not None:
        return _of_samples(settings, settings.sampling.most)
    cells, samples = settings.grid.refined, settings.transition.samples
    if cells:
        return _of_cells(settings, cells, samples, keeps=False)
    cells = math.prod(settings.grid.shape)
    moves = math.prod(settings.action_counts) * samples**settings.model.space.dimension
    return _of_cells(settings, cells, samples, keeps=moves_are_kept(float(cells), moves))


def resolution_memory(settings: Settings) -> float:
    """Bytes that comparing kinds of cells takes at most; 0 if nothing is compared."""
    asked = settings.resolution
    if not asked.counts:
        return 0.0
    largest = max(max(asked.counts_of(kind)) for kind in asked.kinds)
    compared = _of_cells(settings, largest, RESOLUTION_SAMPLES, keeps=False)
    return max(compared, _of_cells(settings, asked.finest, 1, keeps=False))


def _of_cells(settings: ModelSettings, cells: int, samples: int, *, keeps: bool) -> float:
    """Bytes that a model of so many cells takes, whether or not it keeps each of its moves."""
    actions = math.prod(settings.action_counts)
    moves = actions * samples**settings.model.space.dimension
    merged = min(moves, _MERGED_AN_ACTION * actions)
    hypotheses = settings.hypotheses.number
    steps = settings.horizon / settings.dt if isinstance(settings, Settings) else 0
    return (
        float(cells) * (moves * _BYTES_A_MOVE if keeps else merged * _BYTES_A_MERGED_MOVE)
        + float(cells) * steps * _BYTES_A_STEP
        + float(hypotheses) * _BYTES_A_HYPOTHESIS
        + min(ALPHA_BYTES, float(cells) * hypotheses * 16)
        + _BYTES_AT_REST
    )


def _of_samples(settings: ModelSettings, samples: int) -> float:
    """Bytes that the paths of one task take: states and controls, and copies as these are weighed.

    A model of recorded demonstrations does not know how long these take.
    """
    if not isinstance(settings, Settings) or settings.sampling is None:
        return _BYTES_AT_REST
    steps = settings.horizon / settings.dt
    numbers = steps * settings.sampling.substeps * settings.model.space.dimension
    hypotheses = settings.hypotheses.number
    copies = _COPIES_OF_PATHS * numbers + _COPIES_OF_CROSSINGS * hypotheses
    return samples * copies * 8 + _BYTES_AT_REST


def trial_memory(settings: Settings, trials: int) -> float:
    """Bytes that the demonstrator takes for so many trials, which it solves side by side."""
    asked, system = settings.demonstrations, settings.model
    numbers = _NUMBERS_A_DIMENSION * (system.space.dimension + system.control_box.dimension)
    steps = settings.horizon / asked.dt
    return float(trials) * asked.restarts * steps * numbers * 8 + _BYTES_AT_REST


def machine_memory() -> float:
    """Bytes of this machine's memory; infinite where the system does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):
        return math.inf
