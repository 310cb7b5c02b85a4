"""One point of a study, from settings to tables: the walk of the paper's sections III to V."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.console import diagnosis_lines, measure_lines, ranking_lines, trial_line
from experiments.point.beliefs import Shown, calibration_table
from experiments.point.stages import demonstrations, tabular_model
from experiments.point.tables import FIRST, PAPER_SIZE, rank_table, ranking_table, truth_tables
from experiments.point.trajectories import probability_table, telling_trial, trajectory_tables
from experiments.tracking.store import Store
from mlci.maxent import expected_violations, log_partition, sample_moves, violation_probabilities
from mlci.metrics import diagnose, final_state_error, violation_distance
from mlci.simulate import rollout, step_count
from mlci.spaces import Floats
from mlci.tabular import action_grid, forbid

# Random streams beside those of the trials, whose keys have one entry: see sample_trials.
_ROLLOUTS, _SUBSETS = 0, 1


def run_point(
    settings: Settings, store: Store, log: Callable[[str], None]
) -> dict[str, pd.DataFrame]:
    """Run one point.

    Args:
        settings: the point.
        store: where shared stages are kept.
        log: is told what was found, a line or more at a time.

    Returns:
        Tables by name: `trials`, a row a kept demonstration; `ranks`, a row a subset of
        demonstrations; `hypotheses`, a row a hypothesis, ranked with all of them, and `first`,
        with the first FIRST of them; `summary`, one row; `sampled`, `violations`, `moves` and
        `probabilities`, of single trajectories; and the TRUTH_TABLES `attempts`, a row a start
        and goal pair, `paths`, `dimensions` of the state, and `regions` of the truth. If asked
        for, `calibration`.
    """
    trials = demonstrations(settings, store)
    kept = trials.kept(settings.demonstrations.keep)
    counts = trials.counts()
    log(trial_line(counts))
    if not len(kept):
        raise RuntimeError(
            "no demonstration was kept: see the reasons above; widen tasks, or allow more "
            "demonstrations.iterations, restarts or goal_weight"
        )

    system, grid, dt = settings.model, settings.cells, settings.dt
    actions = action_grid(system, list(settings.action_counts))
    hypotheses, steps = settings.candidates, step_count(settings.horizon, dt)
    count = len(hypotheses)
    mdp = tabular_model(settings, store)
    starts = [int(cell) for cell in grid.index(trials.starts[kept])]
    goals = [grid.cells_in(trials.goal(trial)) for trial in kept]
    phi, reachable = expected_violations(mdp, starts, goals, [steps] * len(kept))
    phi = phi[:, :count]
    diagnosis = diagnose(system, grid, actions, dt, mdp)
    unreachable = int(np.sum(~reachable))
    for line in diagnosis_lines(diagnosis, system.space.names, unreachable, len(kept)):
        log(line)

    # Under the truth: final-state error and violation distance.
    constrained = forbid(mdp, np.arange(count, mdp.crosses.shape[1]))
    phi_truth = np.zeros_like(phi)
    feasible = np.zeros(len(kept), dtype=bool)
    trajectories, controls = {}, []
    for j, trial in enumerate(kept):
        log_z = log_partition(constrained, starts[j], goals[j], steps)
        feasible[j] = log_z[0, starts[j]] > -np.inf
        if not feasible[j]:
            continue
        phi_truth[j] = violation_probabilities(constrained, log_z, starts[j])[:count]
        rng = _stream(settings.seed, _ROLLOUTS, trial)
        cells, moves = sample_moves(constrained, log_z, starts[j], settings.rollouts, rng)
        trajectories[int(trial)] = cells[0], moves[0]
        controls.append(actions[mdp.action[moves]])
    error = np.full(len(kept), np.nan)
    if feasible.any():  # all at once: a step of the integrator costs the same for many
        substeps = int(np.ceil(dt / settings.demonstrations.dt - 1e-9))
        origin = trials.starts[kept[feasible], None]
        final = rollout(system, origin, np.stack(controls), dt, substeps)[..., -1, :]
        error[feasible] = [
            np.mean(final_state_error(system.space, ends, trials.goal(trial)))
            for ends, trial in zip(final, kept[feasible], strict=True)
        ]

    violated = hypotheses.violated_by(trials.states[kept])
    each, floor, shares = np.full((3, len(kept)), np.nan)
    if feasible.any():
        distance = violation_distance(phi_truth[feasible], violated[feasible])
        each[feasible], floor[feasible] = distance.each, distance.floor
        shares[feasible] = distance.shares

    covered = hypotheses.inside(settings.constraint)
    met = hypotheses.overlaps(settings.constraint)
    likely = np.max(phi[:, covered], axis=1) if covered.any() else np.full(len(kept), np.nan)
    telling = telling_trial(feasible, phi, covered)
    shown = int(kept[telling]) if feasible.any() else None
    top = settings.ranks.top
    ranks = rank_table(settings, phi, violated, reachable, _stream(settings.seed, _SUBSETS, 0))
    after = ranks[ranks["demonstrations"] == PAPER_SIZE]
    tables = {
        "trials": pd.DataFrame(
            {
                "trial": kept,
                "reachable": reachable,
                "feasible": feasible,
                "final_state_error": error,
                "violation_distance": each,
                "violation_floor": floor,
                "violation_distance_pooled": shares,
                "truth_probability": likely,
            }
        ),
        "ranks": ranks,
        **{
            name: ranking_table(
                hypotheses, phi[:last][reachable[:last]], violated[:last], settings.inference.prior
            ).assign(covered_by_truth=covered, overlaps_truth=met)
            for name, last in (("hypotheses", len(kept)), ("first", FIRST))
        },
        **trajectory_tables(
            mdp, trajectories, dict(zip(kept.tolist(), violated, strict=True)), shown
        ),
        "probabilities": probability_table(shown, phi[telling], phi_truth[telling]),
        **truth_tables(settings, trials, kept),
        "summary": pd.DataFrame(
            [
                {
                    "pairs": len(trials.outcome),
                    **counts,
                    "demonstrations": len(kept),
                    "reachable": int(np.sum(reachable)),
                    "feasible": int(np.sum(feasible)),
                    "final_state_error": _mean(error[feasible]),
                    "violation_distance": _mean(each[feasible]),
                    "violation_floor": _mean(floor[feasible]),
                    "violation_distance_pooled": _mean(shares[feasible]),
                    f"rank_after_{PAPER_SIZE}": after["rank"].median(),
                    f"share_top_{top}_after_{PAPER_SIZE}": after[f"share_top_{top}"].mean(),
                    "stay": diagnosis.stay,
                    "leave": diagnosis.leave,
                    "cells_crossed": diagnosis.cells_crossed,
                    **{
                        f"frozen_{name}": share
                        for name, share in zip(system.space.names, diagnosis.frozen, strict=True)
                    },
                }
            ]
        ),
    }
    if settings.calibration.sets:
        own = Shown(phi, violated, reachable)
        tables["calibration"] = calibration_table(settings, mdp, count, own)
    for line in ranking_lines(tables["hypotheses"], system.space, top):
        log(line)
    summary = tables["summary"].iloc[0]
    for line in measure_lines(summary, tables["ranks"], top):
        log(line)
    return tables


def _stream(seed: int, purpose: int, index: int) -> np.random.Generator:
    """A generator of its own for one purpose and one trial."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(purpose, int(index))))


def _mean(values: Floats) -> float:
    """The mean, NaN of nothing."""
    return float(np.mean(values)) if len(values) else np.nan
