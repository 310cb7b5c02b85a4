"""What one task alone takes: calls of the user's dynamics, and the time of a call.

python -m tests.benchmark.calls
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from mlci.spaces import Floats
from mlci.systems import Pendulum
from tests.benchmark import demonstrations
from tests.benchmark.contest import in_units

_REPEATS = 1000


@dataclass(frozen=True, eq=False)
class _Watched(Pendulum):
    """A pendulum that counts calls and keeps the arguments of the last."""

    calls: dict[str, int] = field(default_factory=dict)
    last: dict[str, tuple[Floats, Floats]] = field(default_factory=dict)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        self._note("dynamics", states, controls)
        return super().dynamics(states, controls)

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        self._note("jacobians", states, controls)
        return super().jacobians(states, controls)

    def _note(self, name: str, states: Floats, controls: Floats) -> None:
        self.calls[name] = self.calls.get(name, 0) + 1
        self.last[name] = states.copy(), controls.copy()


def main() -> None:
    """Print the whole, and for rate and Jacobian how often and how long."""
    members = slice(0, demonstrations.GUESSES)

    def alone() -> object:
        return demonstrations.solve(members, demonstrations.ITERATIONS)

    whole = timing.median_seconds(alone, 21)
    watched = _Watched()
    demonstrations.solve(members, demonstrations.ITERATIONS, watched)
    print(f"{in_units(whole)}  one task alone, {demonstrations.GUESSES} paths")
    for name, calls in watched.calls.items():
        states, controls = watched.last[name]
        call = partial(getattr(demonstrations.SYSTEM, name), states, controls)
        each = timing.median_seconds(partial(_repeat, call), 21) / _REPEATS
        print(
            f"{calls} calls of {name}, states {states.shape}, {in_units(each)} a call: "
            f"{in_units(calls * each)}"
        )


def _repeat(call: Callable[[], object]) -> None:
    """Call it so often that it can be timed."""
    for _ in range(_REPEATS):
        call()


if __name__ == "__main__":
    main()
