"""Parts of straight chords, such as those that lie in a shape, and their algebra.

A chord runs from share 0 to share 1. Its parts are open intervals of shares, which union and
complement take to such intervals again: to touch a border is not to enter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.spaces import Bools, Floats, Ints

_SLIVER = 1e-12  # of a chord: what rounding leaves between two parts is no gap


@dataclass(frozen=True, eq=False)
class Spans:
    """E disjoint parts of P chords, by chord and along it.

    Attributes:
        chords: P.
        chord: (E,) the chord that each is a part of.
        enter: (E,) the share at which it begins, in [0, 1).
        leave: (E,) the share at which it ends, in (0, 1].
    """

    chords: int
    chord: Ints
    enter: Floats
    leave: Floats

    @classmethod
    def of(cls, chords: int, chord: Ints, enter: Floats, leave: Floats) -> Spans:
        """Parts in any order, cut to their chords; those that overlap or meet are joined."""
        enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
        kept = np.flatnonzero(enter < leave)
        kept = kept[np.lexsort([enter[kept], chord[kept]])]
        chord, enter, leave = chord[kept], enter[kept], leave[kept]
        # The furthest end so far in the same chord: ends are compared by their rank, and all of a
        # later chord outrank those of an earlier one.
        ends, rank = np.unique(leave, return_inverse=True)
        furthest = np.maximum.accumulate(chord * len(ends) + rank.ravel())
        reach = ends[furthest - chord * len(ends)] if len(ends) else leave
        begins = np.flatnonzero(
            np.append(True, (chord[1:] != chord[:-1]) | (enter[1:] > reach[:-1]))[: len(chord)]
        )
        lasts = np.append(begins[1:], len(chord))[: len(begins)] - 1
        return cls(chords, chord[begins], enter[begins], reach[lasts])

    @classmethod
    def whole(cls, chords: int, inside: Bools) -> Spans:
        """All of the chords (P,) that are inside."""
        chord = np.flatnonzero(inside)
        return cls(chords, chord, np.zeros(len(chord)), np.ones(len(chord)))

    @classmethod
    def joined(cls, parts: list[Spans]) -> Spans:
        """What at least one of several lists, at least one list, holds of the same chords."""
        columns = zip(*((part.chord, part.enter, part.leave) for part in parts), strict=True)
        chord, enter, leave = (np.concatenate(column) for column in columns)
        return cls.of(parts[0].chords, chord, enter, leave)

    def complement(self) -> Spans:
        """What the parts leave of the chords."""
        every = np.arange(self.chords)
        chord = np.concatenate([every, self.chord])
        begin = np.concatenate([np.zeros(self.chords), self.leave])
        end = np.concatenate([np.ones(self.chords), self.enter])
        # Sorted, each begin stands beside the next end: parts are disjoint.
        chord, enter = chord[order := np.lexsort([begin, chord])], begin[order]
        leave = end[np.lexsort([end, np.concatenate([every, self.chord])])]
        kept = leave - enter > _SLIVER
        return Spans(self.chords, chord[kept], enter[kept], leave[kept])
