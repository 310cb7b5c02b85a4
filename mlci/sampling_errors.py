"""How far probabilities may be off that are sampled, and which of them are not to be believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlci.spaces import Bools, Floats

RESOLVED = 2.0  # standard errors, above which a probability is told from 0


@dataclass(frozen=True, eq=False)
class SamplingErrors:
    """Of N tasks and C regions.

    Attributes:
        errors: (N, C) standard errors of alpha.
        replicates: (R, N, C) alpha as other samples of the same number might give it.
        complaints: (N,) why the samples of a task are not to be believed, a phrase each.
        effective: (N,) effective samples of each task.
    """

    errors: Floats
    replicates: Floats
    complaints: tuple[tuple[str, ...], ...]
    effective: Floats

    @classmethod
    def joined(cls, parts: Sequence[SamplingErrors]) -> SamplingErrors:
        """The tasks of all parts, in order; at least one part."""
        return cls(
            np.concatenate([part.errors for part in parts]),
            np.concatenate([part.replicates for part in parts], axis=1),
            tuple(phrases for part in parts for phrases in part.complaints),
            np.concatenate([part.effective for part in parts]),
        )

    def of(self, tasks: Sequence[int] | slice | np.ndarray) -> SamplingErrors:
        """Some of the tasks, by their numbers or by a mask (N,)."""
        numbers = np.arange(len(self.complaints))[tasks].tolist()
        return SamplingErrors(
            self.errors[numbers],
            self.replicates[:, numbers],
            tuple(self.complaints[number] for number in numbers),
            self.effective[numbers],
        )

    def select(self, regions: np.ndarray) -> SamplingErrors:
        """Some of the regions, by a mask (C,)."""
        return replace(
            self, errors=self.errors[:, regions], replicates=self.replicates[..., regions]
        )

    def unresolved(self, avoidance: Floats) -> Bools:
        """(N, C) of which probabilities the samples tell no more than that they are small.

        That is so where Phi = 1 - alpha, or alpha, is below two of its standard errors.

        Args:
            avoidance: (N, C) alpha.
        """
        return np.minimum(avoidance, 1 - avoidance) < RESOLVED * self.errors

    def warnings(self, names: Sequence[str]) -> list[str]:
        """A line for each task whose samples are not to be believed, by the names (N,) of tasks."""
        return [
            f"the samples of {name} are not to be believed: {'; '.join(phrases)}"
            for name, phrases in zip(names, self.complaints, strict=True)
            if phrases
        ]
