"""The numbers behind the page, as its script reads them: rounded here, so that all show the same.

Evidence and gains are whole thousandths of a nat, None for minus infinity and "inf" for infinity.
Probabilities are whole thousandths; one that would round to 0 or 1, but is neither, is -1 or 1001.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from experiments.page.words import where
from mlci.answers import Answer
from mlci.inference import Inference
from mlci.spaces import Floats, Ints

# A page stays a megabyte or so, and quick to write where each stop estimates a rate anew.
MOST_NUMBERS = 40_000  # of a matrix
MOST_STOPS = 101


def page_numbers(answer: Answer) -> dict[str, Any]:
    """All that changes with the slider or with a click.

    Returns:
        `regions` (C) with name and bounds; `names` (N) of demonstrations; `stops`, the numbers of
        demonstrations at which the slider halts, and for each of them a row of `gain`, `chance`,
        `rank`, and an entry of `none`. For single demonstrations, of the regions in `detailed`:
        `phi`, `forecast` where it differs, `evidence`, and the numbers of the regions that each
        enters (`entered`) or whose Phi a cell decides (`decided`); `reachable` (N).
    """
    inference, regions = answer.inference, answer.inference.hypotheses
    detailed = detailed_regions(inference)
    numbers = {
        "regions": [[name, where(regions, i)] for i, name in enumerate(regions.names)],
        "unseen": answer.unseen.tolist(),
        "names": list(inference.names),
        "detailed": detailed.tolist(),
        "phi": shares(inference.phi[:, detailed]),
        "evidence": nats(inference.evidence[:, detailed]),
        "entered": _places(inference.violated),
        "decided": _places(inference.decided_by_cell),
        "reachable": inference.reachable.tolist(),
        **_after_each(inference),
    }
    if inference.calibration is not None:
        numbers["forecast"] = shares(1 - inference.forecast[:, detailed])
    return numbers


def detailed_regions(inference: Inference) -> Ints:
    """The regions whose single pieces of evidence are on the page: all, or the likeliest."""
    most = max(MOST_NUMBERS // max(len(inference.names), 1), 1)
    return np.sort(inference.order[:most])


def stops(demonstrations: int, regions: int) -> Ints:
    """Numbers of demonstrations at which the slider halts: each, or evenly spread ones."""
    most = max(min(MOST_NUMBERS // max(regions, 1), MOST_STOPS), 2)
    if demonstrations + 1 <= most:
        return np.arange(demonstrations + 1)
    return np.unique(np.linspace(0, demonstrations, most).round().astype(int))


def nats(values: ArrayLike) -> Any:
    """Thousandths of a nat, in nested lists."""
    if np.ndim(values):
        return [nats(value) for value in np.asarray(values)]
    value = float(np.asarray(values))
    return round(1000 * value) if np.isfinite(value) else "inf" if value > 0 else None


def shares(values: ArrayLike) -> Any:
    """Thousandths of a probability, in nested lists."""
    values = np.asarray(values, dtype=float)
    whole = np.round(1000 * values).astype(int)
    whole = np.where((values > 0) & (whole == 0), -1, whole)
    return np.where((values < 1) & (whole == 1000), 1001, whole).tolist()


def _places(mask: np.ndarray) -> list[list[int]]:
    """The numbers where each row is true."""
    return [np.flatnonzero(row).tolist() for row in mask]


def _after_each(inference: Inference) -> dict[str, Any]:
    """The ranking after the first 0, 1, ... demonstrations."""
    counts = stops(len(inference.names), len(inference.hypotheses))
    parts = [inference.of(slice(int(count))) for count in counts]
    finite = [_top(part.gain) for part in parts]
    return {
        "stops": counts.tolist(),
        "gain": [nats(part.gain) for part in parts],
        "chance": [shares(part.posterior) for part in parts],
        "rank": [part.ranking.rank.tolist() for part in parts],
        "none": [shares(part.posterior_none) for part in parts],
        "top": max(1, round(1000 * max(finite, default=0.0))),
    }


def _top(gain: Floats) -> float:
    """The largest finite gain [nat]."""
    return float(np.max(gain[np.isfinite(gain)], initial=0.0))
