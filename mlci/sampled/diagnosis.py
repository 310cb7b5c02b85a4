"""Whether the samples of a task can be believed."""

from __future__ import annotations

from dataclasses import dataclass

from mlci.spaces import Floats

_DIVERGED = (
    "the search for ways to the goal diverged: from every first guess the state overflows. Check "
    "the dynamics, start nearer to the goal, or take a shorter task or step"
)
_EFFECTIVE, _PARETO, _LATE = 100.0, 0.7, 0.02  # what a result needs to be believed


@dataclass(frozen=True, eq=False)
class SamplingDiagnosis:
    """Whether samples can be believed.

    Attributes:
        samples: paths that were drawn; none where the search for ways to the goal diverged.
        reached: share of them that end in the goal and stay in the state space.
        effective: paths of equal weight that would tell as much.
        pareto_k: shape of the weights' tail, see `mlci.sampled.weights.pareto_shape`.
        mode_probability: (M,) probability of the paths that are due to each mode.
        late: probability of the modes that only the second half of the restarts led to; above 0 it
            tells that more restarts may lead to more.
        rounds: of refits.
    """

    samples: int
    reached: float
    effective: float
    pareto_k: float
    mode_probability: Floats
    late: float
    rounds: int

    @property
    def complaints(self) -> list[str]:
        """Why the samples are not to be believed, a phrase each; empty if they are."""
        if not self.samples:
            return [_DIVERGED]
        found = []
        if not self.effective >= _EFFECTIVE:
            found.append(
                f"{self.effective:.0f} effective samples, fewer than {_EFFECTIVE:.0f}: take more"
            )
        if not self.pareto_k <= _PARETO:
            found.append(f"the weights' tail has k = {self.pareto_k:.2f}, above {_PARETO}")
        if self.late > _LATE:
            found.append(
                f"the last restarts still add {self.late:.2f} of the probability: take more"
            )
        return found

    @property
    def trusted(self) -> bool:
        """Whether there is nothing to complain of."""
        return not self.complaints
