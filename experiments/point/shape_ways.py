"""Areas of one or two shapes (`mlci.areas`) against the truth, and what could be reached.

* `shapes`: the area whose expected overlap is largest;
* `likeliest`: the most probable one or two shapes;
* `shown`: the regions of the truth that lie in the way of some demonstration's task, a ceiling;
* `ideal`: `shapes` where the truth is two of the shapes and the tabular model demonstrates, so that
  all that inference assumes is right;
* `chosen`, `ideal_chosen`: `shapes` and `ideal` with tasks that are chosen one after the other, of
  all that were demonstrated, by the overlap that is expected after each (`mlci.areas.next_task`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.config.settings import Settings
from experiments.point.area_ceilings import ideal_world, shown_truth
from experiments.point.area_shapes import pairs_together, shape_evidence, sizes
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.areas.belief import AreaBelief, infer_area
from mlci.areas.evidence import ShapeEvidence
from mlci.areas.next_task import choose_tasks
from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class ShapeWays:
    """What a point's demonstrations say of shapes.

    Attributes:
        settings: the point.
        point: its demonstrations.
        evidence: of all of them.
        together: (C, C) which pairs of shapes may be forbidden together; None where all may.
        truth: (P,) which points of the raster are forbidden.
        cell: (P,) the hypothesis that holds each point, the first one; C where none does.
    """

    settings: Settings
    point: PointInference
    evidence: ShapeEvidence
    together: Bools | None
    truth: Bools
    cell: Ints

    @classmethod
    def of(cls, settings: Settings, point: PointInference) -> ShapeWays | None:
        """Those of a point; None where no shapes are asked for."""
        if not settings.inference.shapes.count:
            return None
        evidence = shape_evidence(
            settings,
            point.tabular,
            point.demonstrations,
            point.inference,
            stream(settings.seed, Purpose.AREAS, 1),
        )
        points, cells = evidence.raster.centers, point.inference.hypotheses
        cell = np.full(len(points), len(cells))
        for i in reversed(range(len(cells))):
            cell[cells.shape(i).level(cells.space, points) < 0] = i
        truth = settings.constraint.signed_distance(points) < 0
        return cls(settings, point, evidence, pairs_together(settings, evidence), truth, cell)

    def scores(
        self, subset: Ints, index: tuple[int, int]
    ) -> tuple[dict[str, dict[str, float]], Floats]:
        """How each way does with some demonstrations, by number.

        Args:
            subset: the numbers.
            index: of the subset's random stream.

        Returns:
            A row a way; and the share (C,) of each hypothesis that is in the area of `shapes`.
        """
        rng = stream(self.settings.seed, Purpose.AREAS, 2, *index)
        evidence = self.evidence.of_some(subset)
        belief = self._belief(evidence, rng)
        likeliest = np.any(evidence.inside[:, list(belief.shapes)], axis=1)
        seen = [self.point.demonstrations[j] for j in subset]
        shown = shown_truth(self.settings.constraint, seen, evidence.raster)
        rows = {
            "shapes": _belief_scores(belief, self.truth),
            "likeliest": {
                **overlap_scores(likeliest, self.truth),
                "regions": float(len(belief.shapes)),
            },
            "shown": {**overlap_scores(shown, self.truth), "regions": np.nan},
        }
        ideal = ideal_world(evidence, rng, self.together)
        if ideal is not None:
            rows["ideal"] = _belief_scores(self._belief(ideal[0], rng), ideal[1])
        count = len(self.point.inference.hypotheses)
        held = np.bincount(self.cell, minlength=count + 1)[:count]
        inside = np.bincount(self.cell, belief.area, minlength=count + 1)[:count]
        return rows, inside / np.maximum(held, 1)

    def chosen(self, counts: Sequence[int]) -> Iterator[tuple[int, str, dict[str, float]]]:
        """How the areas do of tasks that are chosen among all: number, way and scores.

        Args:
            counts: of demonstrations; those above the number of tasks are left out.
        """
        rng = stream(self.settings.seed, Purpose.AREAS, 4)
        worlds = {"chosen": (self.evidence, self.truth)}
        ideal = ideal_world(self.evidence, rng, self.together, spare=True)
        if ideal is not None:
            worlds["ideal_chosen"] = ideal
        for way, (evidence, truth) in worlds.items():
            prior = sizes(self.settings)
            picked = choose_tasks(evidence, max(counts), rng, prior, together=self.together)
            for count in (count for count in counts if count <= len(picked)):
                belief = self._belief(evidence.of_some(picked[:count]), rng)
                yield count, way, _belief_scores(belief, truth)

    def _belief(self, evidence: ShapeEvidence, rng: np.random.Generator) -> AreaBelief:
        """What some evidence says, with the prior of the settings."""
        return infer_area(evidence, rng, sizes(self.settings), together=self.together)


def _belief_scores(belief: AreaBelief, truth: Bools) -> dict[str, float]:
    """How an area does, of how many parts it is, and what it expects."""
    return {
        **overlap_scores(belief.area, truth),
        "regions": float(len(belief.parts)),
        "expected": belief.overlap,
    }


def overlap_scores(area: Bools, truth: Bools) -> dict[str, float]:
    """Overlap of an area (P,) with a truth (P,); nan where there is nothing to divide by."""
    both, either = float(np.sum(area & truth)), float(np.sum(area | truth))
    of_area, of_truth = float(np.sum(area)), float(np.sum(truth))
    return {
        "iou": both / either if either else np.nan,
        "precision": both / of_area if of_area else np.nan,
        "recall": both / of_truth if of_truth else np.nan,
    }
