"""Which boxes straight chords meet: the test behind every crossing.

A chord meets a box if a part of it lies between both sides in every dimension at once, in the
interior: to touch a side is not to enter. Boxes that are near a chord are looked up in *buckets*,
equal cells over the boxes' bounds, so that ten thousand boxes cost a chord hardly more than ten.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.compiled import compiled
from mlci.spaces import Bools, Floats, Ints

_BUCKETS_A_BOX = 4  # at most, so that a long and narrow box is not in thousands


@dataclass(frozen=True, eq=False)
class Boxes:
    """I boxes in n dimensions, and the B buckets that they are in.

    Attributes:
        bounded: (m,) the dimensions in which some box has sides; the others do not count.
        lower, upper: (I, m) corners in these; infinite where a box is free.
        label: (I,) what a box counts for, from 0 on; boxes of one label count once a path.
        origin: (m,) lower corner of the buckets.
        scale: (m,) buckets in a unit of length.
        shape: (m,) number of buckets along each dimension; B is their product.
        begins: (B+1,) those in bucket b are boxes[begins[b]] to boxes[begins[b + 1]].
        boxes: numbers of boxes.
    """

    bounded: Ints
    lower: Floats
    upper: Floats
    label: Ints
    origin: Floats
    scale: Floats
    shape: Ints
    begins: Ints
    boxes: Ints

    @classmethod
    def of(cls, lower: Floats, upper: Floats, label: Ints) -> Boxes:
        """Boxes with corners (I, n), in buckets as wide as they are on average, if these are not
        too many."""
        finite = np.isfinite(lower)
        bounded = np.flatnonzero(np.any(finite, axis=0))
        most = (_BUCKETS_A_BOX * len(lower)) ** (1 / max(1, len(bounded)))
        origin, scale = np.empty((2, len(bounded)))
        shape = np.empty(len(bounded), dtype=np.int64)
        box, bucket = np.arange(len(lower)), np.zeros(len(lower), dtype=np.int64)
        for d, dimension in enumerate(bounded):
            sides = lower[:, dimension], upper[:, dimension]
            first, last = (side[finite[:, dimension]] for side in sides)
            origin[d], extent = np.min(first), np.max(last) - np.min(first)
            shape[d] = max(1, int(min(most, extent / np.mean(last - first) + 1e-9)))
            scale[d] = shape[d] / extent
            # A chord that enters has a point strictly between the sides.
            inner = np.nextafter(sides[0], np.inf), np.nextafter(sides[1], -np.inf)
            with np.errstate(over="ignore"):  # a free side is beyond all buckets
                low, high = (
                    np.clip(np.floor((side - origin[d]) * scale[d]), 0, shape[d] - 1)
                    for side in inner
                )
            low, spans = low.astype(np.int64), (high - low + 1).astype(np.int64)[box]
            place = np.arange(np.sum(spans)) - np.repeat(np.cumsum(spans) - spans, spans)
            bucket = np.repeat(bucket * shape[d] + low[box], spans) + place
            box = np.repeat(box, spans)
        begins = np.append(0, np.cumsum(np.bincount(bucket, minlength=int(np.prod(shape)))))
        boxes = box[np.argsort(bucket, kind="stable")]
        lower, upper = lower[:, bounded].copy(), upper[:, bounded].copy()
        return cls(bounded, lower, upper, label, origin, scale, shape, begins, boxes)

    def hits(
        self, starts: Floats, steps: Floats, tested: Bools
    ) -> tuple[Ints, Ints, Floats, Floats]:
        """The labels that paths of chords meet, each once a path.

        Args:
            starts: (P, K, n) first ends of the chords of P paths.
            steps: (P, K, n) their displacements.
            tested: (P,) which paths to look at; the others meet nothing.

        Returns:
            begins (P+1,), where the labels of each path begin; the labels (E,), rising within a
            path; and of the first chord that meets each, the shares (E,) between which it does.
        """
        corners = self.lower, self.upper, self.label
        buckets = self.origin, self.scale, self.shape, self.begins, self.boxes
        paths, m, labels = len(tested), len(self.bounded), int(np.max(self.label, initial=-1)) + 1
        room = *np.empty((2, m)), *np.empty((3, m), dtype=np.int64), np.full(labels, -1)
        begins, size = np.zeros(paths + 1, dtype=np.int64), 4 * paths + labels
        met: Ints = np.empty(size, dtype=np.int32)
        enters, leaves = np.empty(size), np.empty(size)
        fixed, done = (starts, steps, tested, self.bounded, corners, buckets, room), 0
        while (done := _hits(*fixed, done, begins, met, enters, leaves)) < paths:
            met, enters = np.append(met, met), np.append(enters, enters)
            leaves = np.append(leaves, leaves)
        count = begins[-1]
        return begins, met[:count].copy(), enters[:count].copy(), leaves[:count].copy()


_BOXES = "Tuple((f8[:,::1], f8[:,::1], i8[::1]))"
_BUCKETS = "Tuple((f8[::1], f8[::1], i8[::1], i8[::1], i8[::1]))"
_ROOM = "Tuple((f8[::1], f8[::1], i8[::1], i8[::1], i8[::1], i8[::1]))"
_FOUND = "i8[::1], i4[::1], f8[::1], f8[::1]"


@compiled("UniTuple(f8, 2)(f8[::1], f8[::1], f8[:,::1], f8[:,::1], i8)")
def _shares(start, step, lower, upper, box):  # type: ignore[no-untyped-def]
    """Shares of a chord (m,) between which it is in a box: the first is below the other if it is.

    Slabs: it is between the two sides of a dimension from one share to another, and in the box
    while it is between all of them at once.
    """
    enter, leave = -np.inf, np.inf
    for d in range(len(start)):
        first, last, end = lower[box, d], upper[box, d], start[d] + step[d]
        if not (min(start[d], end) < last and max(start[d], end) > first):
            return np.inf, -np.inf
        if step[d] != 0.0:
            to_first, to_last = (first - start[d]) / step[d], (last - start[d]) / step[d]
            enter = max(enter, min(to_first, to_last))
            leave = min(leave, max(to_first, to_last))
    return enter, leave


@compiled("b1(i8[::1], i8[::1], i8[::1])")
def _advance(bucket, low, high):  # type: ignore[no-untyped-def]
    """Whether there is a next bucket (m,) between two corners; `bucket` becomes it."""
    for d in range(len(bucket) - 1, -1, -1):
        if bucket[d] < high[d]:
            bucket[d] += 1
            return True
        bucket[d] = low[d]
    return False


@compiled(
    f"i8(in f8[:,:,:], in f8[:,:,:], in b1[:], "
    f"i8[::1], {_BOXES}, {_BUCKETS}, {_ROOM}, i8, {_FOUND})"
)
def _hits(  # type: ignore[no-untyped-def]
    starts, steps, tested, bounded, corners, buckets, room, done, ends, found, enters, leaves
):
    """`Boxes.hits`: for each chord, the boxes in each bucket that it may come through.

    It begins with path number `done`, and returns that of the first path for which there may not be
    enough room in what is found, so that it can go on from there with more.
    """
    (lower, upper, label), (origin, scale, shape, begins, boxes) = corners, buckets
    start, step, low, high, bucket, last_path = room  # the last path that met each label
    labels, count = len(last_path), ends[done]
    for path in range(done, len(tested)):
        if count + labels > len(found):
            return path
        for chord in range(starts.shape[1] if tested[path] and labels > 0 else 0):
            going = True
            for d in range(len(bounded)):
                start[d], step[d] = starts[path, chord, bounded[d]], steps[path, chord, bounded[d]]
                end = start[d] + step[d]
                going &= abs(end) < np.inf
                first = (min(start[d], end) - origin[d]) * scale[d]
                last = (max(start[d], end) - origin[d]) * scale[d]
                low[d] = bucket[d] = int(min(max(first, 0.0), shape[d] - 1.0))
                high[d] = int(min(max(last, 0.0), shape[d] - 1.0))
            while going:
                number = 0
                for d in range(len(bounded)):
                    number = number * shape[d] + bucket[d]
                for entry in range(begins[number], begins[number + 1]):
                    box = boxes[entry]
                    if last_path[label[box]] == path:
                        continue
                    enter, leave = _shares(start, step, lower, upper, box)
                    if enter < leave:
                        last_path[label[box]] = path
                        place = count
                        while place > ends[path] and found[place - 1] > label[box]:
                            found[place] = found[place - 1]
                            enters[place], leaves[place] = enters[place - 1], leaves[place - 1]
                            place -= 1
                        found[place], enters[place], leaves[place] = label[box], enter, leave
                        count += 1
                going = _advance(bucket, low, high)
        ends[path + 1] = count
    return len(tested)
