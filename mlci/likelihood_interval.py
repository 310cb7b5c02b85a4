"""Where a log likelihood of one number is largest, and the interval that its ratio test leaves.

The interval reaches from the smallest to the largest value with 2 (max log L - log L) <= q, where q
is the quantile of chi^2 with one degree of freedom.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy  # loads scipy.optimize when it is first used: most commands never do

from mlci.spaces import Floats

# Half the 95 % quantile of chi^2: what the log likelihood drops to the interval's ends [nat].
DROP = 1.920729410347062


def likelihood_interval(
    log_likelihood: Callable[[float], float],
    grid: Floats,
    values: Floats | None = None,
    tolerance: float = 1e-12,
) -> tuple[float, float, float]:
    """Best value, lower and upper end of its 95 % interval; an open end is the grid's.

    Args:
        log_likelihood: of a number [nat].
        grid: (Q,) numbers to begin with, ascending; peaks that are wider than its steps are told
            apart.
        values: (Q,) log likelihood there, if it is known.
        tolerance: of the ends; of the best value it is the square root, as a peak is flat.
    """
    if values is None:
        values = np.array([log_likelihood(float(number)) for number in grid])
    at = int(np.argmax(values))
    best, highest = float(grid[at]), float(values[at])
    near = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    peak = scipy.optimize.minimize_scalar(
        lambda number: -log_likelihood(number),
        bounds=near,
        method="bounded",
        options={"xatol": np.sqrt(tolerance)},
    )
    if -peak.fun > highest:
        best, highest = float(peak.x), float(-peak.fun)
    level = highest - DROP

    def crossing(outside: int, inside: float) -> float:
        """Where the level is passed between a number of the grid and one that is above it."""
        ends = float(grid[outside]), inside
        return float(
            scipy.optimize.brentq(
                lambda number: log_likelihood(number) - level, *ends, xtol=tolerance
            )
        )

    inside = np.append(grid[values >= level], best)  # perhaps no number of the grid
    low, high = float(np.min(inside)), float(np.max(inside))
    return (
        best,
        crossing(int(np.searchsorted(grid, low)) - 1, low) if low > grid[0] else low,
        crossing(int(np.searchsorted(grid, high, "right")), high) if high < grid[-1] else high,
    )
