"""How far probabilities may be off that are sampled, and which of them are not to be believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlci.spaces import Floats


@dataclass(frozen=True, eq=False)
class SamplingErrors:
    """Of N tasks and C regions.

    Attributes:
        errors: (N, C) standard errors of alpha.
        replicates: (R, N, C) alpha as other samples of the same number might give it.
        complaints: (N,) why the samples of a task are not to be believed, a phrase each.
    """

    errors: Floats
    replicates: Floats
    complaints: tuple[tuple[str, ...], ...]

    @classmethod
    def joined(cls, parts: Sequence[SamplingErrors]) -> SamplingErrors:
        """The tasks of all parts, in order; at least one part."""
        return cls(
            np.concatenate([part.errors for part in parts]),
            np.concatenate([part.replicates for part in parts], axis=1),
            tuple(phrases for part in parts for phrases in part.complaints),
        )

    def of(self, tasks: Sequence[int] | slice | np.ndarray) -> SamplingErrors:
        """Some of the tasks, by their numbers or by a mask (N,)."""
        numbers = np.arange(len(self.complaints))[tasks].tolist()
        return SamplingErrors(
            self.errors[numbers],
            self.replicates[:, numbers],
            tuple(self.complaints[number] for number in numbers),
        )

    def select(self, regions: np.ndarray) -> SamplingErrors:
        """Some of the regions, by a mask (C,)."""
        return SamplingErrors(
            self.errors[:, regions], self.replicates[..., regions], self.complaints
        )

    def warnings(self, names: Sequence[str]) -> list[str]:
        """A line for each task whose samples are not to be believed, by the names (N,) of tasks."""
        return [
            f"the samples of {name} are not to be believed: {'; '.join(phrases)}"
            for name, phrases in zip(names, self.complaints, strict=True)
            if phrases
        ]
