"""Another effort: a system whose running reward counts more than the system's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.spaces import Floats
from mlci.wrapped import Wrapped


@dataclass(frozen=True, eq=False)
class WithEffort(Wrapped):
    """A system that moves as another does and has the reward r(x, u) - sum_d price_d z_d^2.

    Attributes:
        system: the other one, with its reward r.
        price: (n + m,) of each square, where z = (x, u); 0 for states that go round.

    Raises:
        ValueError: not n + m prices, or one above 0 for a state that goes round.
    """

    price: Floats

    def __post_init__(self) -> None:
        space, price = self.space, np.asarray(self.price, dtype=float)
        size = space.dimension + self.control_box.dimension
        if price.shape != (size,):
            raise ValueError(f"an effort needs {size} prices, not {price.tolist()}")
        if np.any(price[: space.dimension][space.periodic]):
            raise ValueError("the square of a state that goes round jumps: give it the price 0")
        object.__setattr__(self, "price", price)

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        n = states.shape[-1]
        return (
            self.system.running_reward(states, controls)
            - np.square(states) @ self.price[:n]
            - np.square(controls) @ self.price[n:]
        )

    def reward_derivatives(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        gradient, hessian = self.system.reward_derivatives(states, controls)
        n, more = states.shape[-1], np.zeros(gradient.shape)
        more[..., :n], more[..., n:] = states, controls
        return gradient - 2 * self.price * more, hessian - 2 * np.diag(self.price)
