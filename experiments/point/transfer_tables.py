"""Whether what was inferred keeps others out of the truth: with controls of another strength.

The region that comes first is kept out of by its own safe set, solved anew for each strength. What
is compared with it is the *tube* that was learned at the nominal strength: the complement of the
region's safe set there, which is what nominal demonstrators avoid, and at best all that can be
learned of them where the region is not told from the states that lead to it. The union of the cells
that no demonstration has entered stands beside both: it is what was seen to be avoided.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pandas as pd

import mlci.safety.reachability
from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.keep_out import derived_margin
from experiments.point.stages import (
    region_inputs,
    settled_safe_set,
    shape_modules,
    system_module,
)
from experiments.point.streams import Purpose, stream
from experiments.tracking.store import Store
from mlci.control.control_problem import ControlFilter, NoFilter
from mlci.demonstrator import enters, first_guesses
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import SafeSet
from mlci.safety.safety_filter import SafetyFilter
from mlci.simulate import EULER, step_count
from mlci.spaces import Bools, Floats
from mlci.strength import WithStrength

OWN, TUBE, UNSEEN, FREE = "own safe set", "tube", "never entered", "no filter"
NOMINAL = 1.0  # the strength of demonstrators and model
_SHOWN = 48  # values along each dimension that are kept for figures


def transfer_tables(
    settings: Settings, point: PointInference, store: Store
) -> dict[str, pd.DataFrame]:
    """What is let through at each strength, and the safe sets of the region for figures.

    Returns:
        `transfer`, a row a strength and `method`: the `region` that was inferred, and whether it is
        the truth (`right`); of random `states`, how many are `safe` there, can keep out of the
        truth for ever, and how many of these the method refuses (`refused`); how many are `doomed`,
        not in the truth and yet not safe, and how many of those it lets through (`admitted`); of
        `trials` of random controls from states that it lets through, how many `entered` the truth.
        `transfer_values`, a row a `region`, strength and state: the value of its safe set.
    """
    inferred = int(point.inference.order[0])
    region = point.inference.hypotheses.select(
        np.arange(len(point.inference.hypotheses)) == inferred
    )
    truth = settings.constraint
    right = bool(region.inside(truth)[0] and truth.inside(region).all())
    strengths = settings.transfer.strengths
    sets = {each: _solved(settings, store, region, each) for each in {*strengths, NOMINAL}}
    rows, values = [], []
    for number, strength in enumerate(strengths):
        true = sets[strength] if right else _solved(settings, store, truth, strength)
        deployment = _Deployment(settings, point, strength, number, true)
        for method, row in deployment.rows(sets):
            opening = {"strength": strength, "method": method, "region": region.names[0]}
            rows.append({**opening, "right": right, **row})
        opening = {"region": region.names[0], "strength": strength}
        values.append(_values(settings, sets[strength], opening))
    return {"transfer": pd.DataFrame(rows), "transfer_values": pd.concat(values)}


class _Deployment:
    """A system of some strength that is to keep out of the truth."""

    def __init__(
        self, settings: Settings, point: PointInference, strength: float, number: int, true: SafeSet
    ) -> None:
        self.settings, self.point, self.number = settings, point, number
        self.system = WithStrength(settings.model, strength)
        self.strength, self.true = strength, true
        self.dt = settings.demonstrations.dt
        states = self._states(0, settings.transfer.states)
        self.inside = settings.constraint.signed_distance(states) < 0
        self.states, self.safe = states, true.contains(states)

    def rows(self, sets: dict[float, SafeSet]) -> Iterator[tuple[str, dict[str, float]]]:
        """The numbers of each method."""
        for method, strength in ((OWN, self.strength), (TUBE, NOMINAL)):
            safe_set = sets[strength]
            margin = self.settings.safety.margin
            if margin is None:
                system = WithStrength(self.settings.model, strength)
                margin = derived_margin(system, safe_set, self.dt)
            keep_out = SafetyFilter(self.system, safe_set, self.dt, margin)
            starts = self._starts(safe_set, margin)
            yield (
                method,
                {
                    "margin": margin,
                    **self._counts(safe_set.contains(self.states, margin)),
                    **self._trials(starts, keep_out),
                },
            )
            if method == OWN:
                yield FREE, {**self._counts(~self.inside), **self._trials(starts, NoFilter())}
        cells = Grid(self.settings.model.space, self.settings.cells.shape)
        entered = np.zeros(cells.size, dtype=bool)
        for demonstration in self.point.demonstrations:
            entered[cells.index(demonstration.states)] = True
        yield UNSEEN, self._counts(entered[cells.index(self.states)])

    def _counts(self, passes: Bools) -> dict[str, float]:
        """How a method's view of the states compares with what is so."""
        doomed = ~self.safe & ~self.inside
        return {
            "states": len(self.states),
            "safe": int(np.sum(self.safe)),
            "refused": int(np.sum(self.safe & ~passes)),
            "doomed": int(np.sum(doomed)),
            "admitted": int(np.sum(doomed & passes)),
        }

    def _states(self, purpose: int, count: int) -> Floats:
        """Random states of the task box."""
        rng = stream(self.settings.seed, Purpose.TRANSFER, self.number, purpose)
        box = self.settings.tasks.start_box(self.settings.model.space)
        return rng.uniform(box.lower, box.upper, size=(count, box.dimension))

    def _starts(self, safe_set: SafeSet, margin: float) -> Floats:
        """States that a safe set lets through, as many as there are trials, or fewer."""
        trials = self.settings.transfer.trials
        states = self._states(1, 20 * trials)
        return states[safe_set.contains(states, margin)][:trials]

    def _trials(self, starts: Floats, keep_out: ControlFilter) -> dict[str, float]:
        """How many paths enter the truth under random controls that a filter lets through."""
        steps = step_count(self.settings.horizon, self.dt)
        hold = max(1, round(self.settings.demonstrations.hold / self.dt))
        rng = stream(self.settings.seed, Purpose.TRANSFER, self.number, 2)
        wanted = first_guesses(rng, self.system.control_box, steps, hold, len(starts))
        states, applied = [starts], []
        for k in range(steps):
            applied.append(keep_out.apply(states[-1], wanted[:, k]))
            states.append(EULER.step(self.system, states[-1], applied[-1], self.dt))
        paths = np.stack(states, axis=1), np.stack(applied, axis=1)
        entered = enters(self.system, self.settings.constraint, *paths, self.dt)
        return {"trials": len(starts), "entered": int(np.sum(entered))}


def _solved(settings: Settings, store: Store, region: Regions, strength: float) -> SafeSet:
    """The safe set of a region for controls of some strength, stored or computed."""
    grid = Grid(settings.model.space, settings.safety.shape)

    def compute() -> dict[str, np.ndarray]:
        system, asked = WithStrength(settings.model, strength), f"transfer.strengths: {strength:g}"
        safe = settled_safe_set(system, grid, region, asked)
        return {"values": safe.values, "gradients": safe.gradients}

    of_region = region.names, region_inputs(settings, region)
    inputs = (settings.system, of_region, settings.safety.shape, strength)
    modules = [mlci.safety.reachability, system_module(settings.model), sys.modules[__name__]]
    modules += shape_modules(settings, region)
    stored = store.get("deployed_safe_set", inputs, modules, compute)
    return SafeSet(grid, stored["values"], stored["gradients"])


def _values(settings: Settings, safe_set: SafeSet, opening: dict[str, object]) -> pd.DataFrame:
    """Values of a safe set on a coarse grid, for a figure."""
    space = settings.model.space
    axes = [
        np.linspace(low, high, _SHOWN)
        for low, high in zip(space.bounds.lower, space.bounds.upper, strict=True)
    ]
    states = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    columns = {f"state_{d + 1}": states[:, d] for d in range(len(axes))}
    return pd.DataFrame({**opening, **columns, "value": safe_set.value(states)})
