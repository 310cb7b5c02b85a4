"""What demonstrations say of any set of hypotheses, in worlds of certain moves and of chance.

Where moves are certain it is `mlci.sets.evidence`. Where chance decides, the evidence of a path is

    l = log P(actions | set) - log P(actions | nothing),

of the policies of `mlci.rivals.agent`, action by action where the path was; see
`mlci.worlds.inference`, whose rates count here too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mlci.evidence import PAPER, Rates, decided_by_cell, total_gain
from mlci.rivals.agent import Agent
from mlci.rivals.problem import Beside, Problem, Shown
from mlci.sets.evidence import SetEvidence, SetGains
from mlci.spaces import Bools, Floats


def set_gains(problem: Problem, rates: Rates = PAPER, exact_ends: bool = True) -> SetGains:
    """What the demonstrations of a problem say of sets.

    Args:
        problem: the problem.
        rates: model error and rule breaking.
        exact_ends: begin and end at states where these are known, not at cells; what a cell alone
            decides then says nothing.
    """
    if any(each.avoidance is None for each in problem.shown):
        return ChanceGains(problem, rates)
    once: dict[int, Beside] = {}  # demonstrations of one task share what is asked of it

    def kept(beside: Beside | None) -> Beside | None:
        return beside and once.setdefault(id(beside), _remembered(beside))

    exact = [kept(each.avoidance) for each in problem.shown]
    between = [kept(each.between_cells or each.avoidance) for each in problem.shown]
    if not exact_ends:
        return SetEvidence(between, problem.violated, rates)
    return SetEvidence(exact, problem.violated, rates, _silent(problem, exact, between))


def _remembered(beside: Beside) -> Beside:
    """The same, whose answers are kept."""
    known: dict[bytes, Floats] = {}

    def asked(mask: Bools) -> Floats:
        key = mask.tobytes()
        if key not in known:
            known[key] = beside(mask)
        return known[key]

    return asked


def _silent(problem: Problem, exact: list[Beside | None], between: list[Beside | None]) -> Bools:
    """(N, C) pairs that a cell decides."""
    nothing, silent = np.zeros(problem.regions, dtype=bool), np.zeros_like(problem.violated)
    for j, (states, cells) in enumerate(zip(exact, between, strict=True)):
        if states is not cells and states is not None and cells is not None:
            alphas = [np.minimum(np.exp(each(nothing)), 1.0) for each in (cells, states)]
            silent[j] = decided_by_cell(*alphas)
    return silent


@dataclass(frozen=True, eq=False)
class ChanceGains:
    """Gains of sets where chance decides what follows a move.

    Attributes:
        problem: whose demonstrations have actions, and at most one goal for all.
        rates: model error and rule breaking.
    """

    problem: Problem
    rates: Rates = PAPER
    _known: dict[bytes, Floats] = field(default_factory=dict)

    @property
    def regions(self) -> int:
        """C."""
        return self.problem.regions

    @property
    def feasible(self) -> Bools:
        """(C,) regions that may be in a set."""
        if self.rates.rule_breaking > 0:
            return np.ones(self.regions, dtype=bool)
        return self.problem.feasible

    def beside(self, members: Bools) -> Floats:
        """(C,) gain of a set together with each region [nat]; remembered."""
        key = np.packbits(members).tobytes()
        if key not in self._known:
            own = self._gains(members[None])[0] if np.any(members) else 0.0
            gains = np.where(members, own, -np.inf)
            more = np.flatnonzero(self.feasible & ~members)
            if own > -np.inf and len(more):
                gains[more] = self._gains(members | np.eye(self.regions, dtype=bool)[more])
            self._known[key] = gains
        return self._known[key]

    def gain(self, members: Bools) -> float:
        """The gain of a set [nat]; 0 of none."""
        return float(self._gains(members[None])[0]) if np.any(members) else 0.0

    def _gains(self, sets: Bools) -> Floats:
        """(B,) gains of sets (B, C)."""
        ratio = np.empty((len(self.problem.shown), len(sets)))
        for agent, numbers in self.problem.tasks:
            ratio[numbers] = log_ratios(agent, [self.problem.shown[j] for j in numbers], sets)
        crossed = (self.problem.violated @ sets.T.astype(int)) > 0
        return total_gain(evidence(np.where(crossed, -np.inf, ratio), self.rates))


def evidence(log_ratio: Floats, rates: Rates) -> Floats:
    """Log evidence [nat] of log likelihood ratios of any shape; -inf for a violation."""
    eta, eps = np.float64(rates.model_error), np.float64(rates.rule_breaking)
    with np.errstate(divide="ignore"):
        inverse = np.logaddexp(np.log1p(-eta) - log_ratio, np.log(eta))
        return np.asarray(np.logaddexp(np.log1p(-eps) - inverse, np.log(eps)))


def log_ratios(agent: Agent, shown: Sequence[Shown], sets: Bools) -> Floats:
    """l (N, B) [nat] of an agent's demonstrations for sets (B, C)."""
    table, shape = agent.table, agent.table.reward.shape
    blocks = np.vstack([np.zeros_like(sets[:1]), sets])
    allowed = ((table.crosses @ blocks.T.astype(float)) == 0).reshape(*shape, -1)
    allowed &= table.allowed[:, :, None]
    ends = ~np.any(allowed, axis=1)  # goals, and where a slip leaves no way on
    never = np.where(allowed, 0.0, -np.inf) + table.reward[:, :, None]
    chances, after = table.transitions.toarray(), np.zeros((table.states, len(blocks)))
    total = np.zeros((len(shown), len(blocks)))
    for t in reversed(range(agent.steps)):
        value = never + (agent.discount * (chances @ after)).reshape(allowed.shape)
        most = np.where(ends, 0.0, np.max(value, axis=1))
        with np.errstate(divide="ignore"):
            after = most + np.log(np.sum(np.exp(value - most[:, None]), axis=1))
        after[ends] = 0.0
        for row, each in zip(total, shown, strict=True):
            assert each.actions is not None
            if t < len(each.actions):
                state = each.states[t]
                row += value[state, each.actions[t]] - after[state]
    return total[:, 1:] - total[:, :1]


def single_avoidance(problem: Problem) -> Floats:
    """(N, C) e^-l for each hypothesis alone, at most 1: what takes the place of alpha."""
    if any(each.avoidance is None for each in problem.shown):
        one_by_one, alpha = np.eye(problem.regions, dtype=bool), np.ones(problem.violated.shape)
        for agent, numbers in problem.tasks:
            shown = [problem.shown[j] for j in numbers]
            alpha[numbers] = np.exp(-log_ratios(agent, shown, one_by_one))
        return np.where(problem.violated, 1.0, np.minimum(alpha, 1.0))
    gains = set_gains(problem)
    assert isinstance(gains, SetEvidence)
    nothing, each = np.zeros(problem.regions, dtype=bool), gains.avoidance
    log_alpha = [np.zeros(problem.regions) if f is None else f(nothing) for f in each]
    return np.where(gains.silent, 1.0, np.minimum(np.exp(log_alpha), 1.0))
