"""Can a recording be what it claims? Doubts in words and numbers, before anything is ranked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mlci.crossings import ANY, Crossing, crossed, stays
from mlci.demonstrations import Demonstration
from mlci.recordings.motion import Motion, motion
from mlci.recordings.noise import Spike, noise, spikes
from mlci.regions import Regions
from mlci.spaces import Floats, StateSpace
from mlci.systems import System

_NEARLY_HALF = 0.4  # of a period
_WHOLE = 0.1  # of a turn
_MOSTLY = 0.8  # of the windows
_DEEP = 2.0  # standard deviations of the noise: a crossing that is less deep may be noise
_MOST_SHOWN = 6
# What makes a dimension move so many times faster than the others say.
_FACTORS = {
    57.296: "is it in degrees? then units=UNITS",
    1 / 57.296: "was it in radians before it was converted from degrees?",
    1000.0: "is it in thousandths of its unit, as millimetres?",
    0.001: "is time in ms, or the state in thousands of its unit?",
    100.0: "is it in hundredths of its unit, as centimetres?",
    10.0: "is it in tenths of its unit?",
    60.0: "is time in minutes?",
}
# Kinds of doubts, as a summary of many recordings says them.
MOTION, TURNS, STEPS, SPIKE, SHALLOW = (
    "do not move as the dynamics allow",
    "turn by nearly half a turn or more between samples",
    "have steps wider than a region",
    "have samples that jump out and back, as bad ones do",
    "enter regions by less than their noise",
)


@dataclass(frozen=True, eq=False)
class Plausibility:
    """What is known of a recording from itself.

    Attributes:
        name: of the demonstration.
        motion: how its motion compares with the dynamics.
        noise: (n,) standard deviation of the samples round a smooth path [unit of x].
        doubts: kind and words of each.
    """

    name: str
    motion: Motion
    noise: Floats
    doubts: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        return f"{self.name}: {'; '.join(text for _, text in self.doubts)}"

    def record(self, space: StateSpace) -> dict[str, Any]:
        """For programs, fit for JSON; numbers by the names of the dimensions."""
        columns = {
            "median_residual": self.motion.median,
            "worst_residual": self.motion.worst,
            "factor": self.motion.factor,
            "noise": self.noise,
        }
        numbers = {
            key: {
                name: float(value) if np.isfinite(value) else None
                for name, value in zip(space.names, values, strict=True)
            }
            for key, values in columns.items()
        }
        return {"name": self.name, "doubts": [text for _, text in self.doubts], **numbers}


def plausibility(
    system: System, regions: Regions, demonstration: Demonstration, crossing: Crossing = ANY
) -> Plausibility:
    """Compare a recording with the dynamics and the regions.

    Args:
        system: the dynamics and the control box.
        regions: the hypotheses.
        demonstration: the recording.
        crossing: what counts as entering a region.
    """
    path, time = demonstration.states, demonstration.times
    moves, spread = motion(system, path, time), noise(path, time)
    bad = spikes(system, path, time)
    good = np.ones(len(path), dtype=bool)
    for spike in bad:
        good[spike.first : spike.last + 1] = False
    turns = list(_turn_doubts(system.space, path[good], time[good], moves))
    unlike = [] if turns else list(_motion_doubts(system, path, moves))
    found = [
        *turns,
        *unlike,
        *([] if unlike else _step_doubts(regions, path[good])),
        *_spike_doubts(regions, demonstration, bad, good, crossing),
        *_shallow_doubts(regions, demonstration, spread, good, crossing),
    ]
    return Plausibility(demonstration.name, moves, spread, tuple(found))


def summary(checks: Sequence[Plausibility]) -> list[str]:
    """A phrase for each kind of doubt, with the names of the recordings."""
    phrases = []
    for kind in (MOTION, TURNS, STEPS, SPIKE, SHALLOW):
        names = [check.name for check in checks if any(kind == of for of, _ in check.doubts)]
        if names:
            phrases.append(f"{len(names)} of {len(checks)} recordings {kind}: {_listed(names)}")
    return phrases


def _turn_doubts(
    space: StateSpace, path: Floats, time: Floats, moves: Motion
) -> Iterator[tuple[str, str]]:
    """Steps of nearly half a turn or more, whose direction is a guess."""
    steps, usual = np.abs(np.diff(path, axis=0)), float(np.median(np.diff(time)))
    for d in np.flatnonzero(space.periodic):
        period = space.bounds.widths[d]
        wide = steps[:, d] > _NEARLY_HALF * period
        # Turns a step that the dynamics make and the path does not: whole ones where samples hide
        # them.
        lost = np.abs(moves.residuals[:, d]) * usual / period
        whole = np.abs(lost - np.round(lost)) < _WHOLE
        if np.median(lost) > 1 - _WHOLE and np.mean(whole) > _MOSTLY:
            yield (
                TURNS,
                f"{_words(space.names[d])} turns by more than half a turn between samples, as the "
                f"dynamics say: {np.median(lost):.0f} whole turn(s) a step are lost; sample faster",
            )
        elif wide.any():
            yield (
                TURNS,
                f"{_words(space.names[d])} turns by up to {steps[:, d].max():.3g} {space.units[d]} "
                f"between samples ({wide.sum()} of {len(steps)} steps), nearly half a turn: which "
                "way it went is a guess; sample faster",
            )


def _motion_doubts(system: System, path: Floats, moves: Motion) -> Iterator[tuple[str, str]]:
    """Dimensions that no control in range moves so."""
    space = system.space
    for d in np.flatnonzero(moves.unlike(space.bounds.widths)):
        name, factor = _words(space.names[d]), moves.factor[d]
        unit = f"{space.units[d]}/s"
        off = f"(residual: median {moves.median[d]:.3g}, worst {moves.worst[d]:.3g} {unit})"
        if moves.driven[d] or not (np.isfinite(factor) and (factor > 1.2 or factor < 1 / 1.2)):
            yield (
                MOTION,
                f"{name} moves as no control in range moves it {off}: are units, columns, times "
                "and the control range right?",
            )
            continue
        sources = " and ".join(_sources(system, path, int(d))) or "the dynamics"
        times, than = (factor, "faster") if factor > 1 else (1 / factor, "slower")
        causes = [text for known, text in _FACTORS.items() if abs(factor / known - 1) < 0.03]
        if causes and "degrees" in causes[0] and "rad" not in space.units[d]:
            causes = []
        units = f"{{{space.names[d]}: {space.units[d].replace('rad', 'deg')}}}"
        cause = causes[0] if causes else "are units, columns and times right?"
        cause = cause.replace("UNITS", units)
        yield MOTION, f"{name} moves {times:.3g} times {than} than {sources} says {off}: {cause}"


def _sources(system: System, path: Floats, d: int) -> list[str]:
    """The dimensions that the rate of a dimension depends on."""
    middle = (system.control_box.lower + system.control_box.upper) / 2
    by_state, _ = system.jacobians(path, np.broadcast_to(middle, (len(path), len(middle))))
    return [
        _words(name)
        for i, name in enumerate(system.space.names)
        if np.any(np.abs(by_state[:, d, i]) > 1e-9)
    ]


def _step_doubts(regions: Regions, path: Floats) -> Iterator[tuple[str, str]]:
    """Steps that a region fits into."""
    space = regions.space
    steps, sides = np.abs(np.diff(path, axis=0)), regions.upper - regions.lower
    for d in range(space.dimension):
        narrowest = np.min(sides[:, d], initial=np.inf)
        wide = steps[:, d] > narrowest
        if wide.any():
            yield (
                STEPS,
                f"{wide.sum()} of {len(steps)} steps are wider in {_words(space.names[d])} than a "
                f"region (up to {steps[:, d].max():.3g} of {narrowest:.3g} {space.units[d]}): what "
                "lies between the samples is a guess",
            )


def _spike_doubts(
    regions: Regions,
    demonstration: Demonstration,
    bad: Sequence[Spike],
    good: np.ndarray,
    crossing: Crossing,
) -> Iterator[tuple[str, str]]:
    """Bad samples, and what they alone decide."""
    if not bad:
        return
    path, time = demonstration.states, demonstration.times
    space = regions.space
    parts = [path, path[good]], [time, time[good]]
    entered, without = crossed(regions, *parts, crossing)
    alone = _regions(regions, entered & ~without)
    at = _listed([f"{time[spike.first]:.6g} s" for spike in bad])
    widest = max(bad, key=lambda spike: spike.size / space.bounds.widths[spike.dimension])
    stand = "a sample jumps" if len(bad) == 1 and bad[0].first == bad[0].last else "samples jump"
    around = max(time[spike.last + 1] - time[spike.first - 1] for spike in bad)
    enough = np.ceil(1000 * around - 1e-6) / 1000
    decides = (
        f"; the path enters {alone} there alone, which this refutes: correct the file, or leave "
        f"such visits out by crossing.time={enough:g}"
        if alone
        else ", which decides no region"
    )
    yield (
        SPIKE,
        f"at {at} {stand} out and back by up to {widest.size:.3g} "
        f"{space.units[widest.dimension]} in {_words(space.names[widest.dimension])}, faster than "
        f"the dynamics allow{decides}",
    )


def _shallow_doubts(
    regions: Regions,
    demonstration: Demonstration,
    spread: Floats,
    good: np.ndarray,
    crossing: Crossing,
) -> Iterator[tuple[str, str]]:
    """Regions that are entered, but by no more than the noise."""
    path, time, space = demonstration.states[good], demonstration.times[good], regions.space
    entered = crossed(regions, [path], [time], crossing)[0]
    tiny = 1e-12 * space.bounds.widths
    in_noise, in_widths = (
        stays(regions, path, time, unit) for unit in (np.maximum(spread, tiny), None)
    )
    deepest, share = np.zeros((2, len(regions)))
    np.maximum.at(deepest, in_noise.region, in_noise.depth)
    np.maximum.at(share, in_widths.region, in_widths.depth)
    shallow = entered & (deepest < _DEEP)
    if shallow.any() and np.any(spread > 0):
        noises = ", ".join(
            f"{_words(name)} {size:.2g} {unit}"
            for name, size, unit in zip(space.names, spread, space.units, strict=True)
        )
        enough = np.ceil(100 * share[shallow].max() + 1e-9) / 100
        yield (
            SHALLOW,
            f"enters {_regions(regions, shallow)} by less than twice its noise ({noises}): "
            f"crossing.depth={min(enough, 0.49):g} would not count that",
        )


def _regions(regions: Regions, mask: np.ndarray) -> str:
    """The names of some regions; "" for none."""
    names = [name for name, is_in in zip(regions.names, mask, strict=True) if is_in]
    return f"region{'s' if len(names) > 1 else ''} {_listed(names)}" if names else ""


def _listed(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - _MOST_SHOWN} more" if len(names) > _MOST_SHOWN else ""
    return ", ".join(names[:_MOST_SHOWN]) + more


def _words(name: str) -> str:
    """A dimension's name as a reader would write it."""
    return name.replace("_", " ")
