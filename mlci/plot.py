"""A map of ranked hypotheses with the paths of demonstrations; it alone knows matplotlib."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path

from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.outlines import outline
from mlci.planes import Plane, planes

TOP = 5  # regions whose rank is written on the map
_COLOURS = "YlGnBu"  # safe for the colour-blind, and told apart in grey
_RULED_OUT, _UNAVOIDABLE, _PATH, _EDGE = "#e8e8e8", "#1a1a1a", "#444444", "#b0b0b0"
_NEARLY_NONE = 1e-3  # nat: the top of the scale if no gain is larger


def draw_map(
    inference: Inference,
    demonstrations: Sequence[Demonstration] = (),
    axes: Axes | None = None,
    dimensions: tuple[int, int] | None = None,
) -> Axes:
    """Draw hypotheses in the colour of their gain, the ranks of the first five, and paths.

    Of hypotheses that lie on one another the likeliest is seen. One that a demonstration rules out
    is grey, one of infinite gain black. A path leads from a dot to a square.

    Args:
        inference: whose hypotheses are drawn.
        demonstrations: those whose paths are drawn.
        axes: what to draw on; None makes a figure.
        dimensions: numbers of the horizontal and the vertical dimension; None takes the first two
            that hypotheses bound.
    """
    regions, gain, rank = inference.hypotheses, inference.gain, inference.ranking.rank
    if axes is None:
        axes = Figure(figsize=(6.0, 4.5), layout="constrained").subplots()
    plane = planes(regions)[0] if dimensions is None else Plane(regions.space, *dimensions)
    finite = gain[np.isfinite(gain)]
    # Gains spread over decades: the square root keeps the small ones apart from none.
    scale = PowerNorm(0.5, 0.0, max(float(finite.max(initial=0.0)), _NEARLY_NONE))
    colours = ScalarMappable(scale, _COLOURS)
    shapes: list[Any] = []
    faces: list[Any] = []
    for i in np.argsort(-rank, kind="stable"):
        colour: Any = colours.to_rgba(np.clip(gain[i], 0.0, scale.vmax))
        if gain[i] == -np.inf:
            colour = _RULED_OUT
        elif gain[i] == np.inf:
            colour = _UNAVOIDABLE
        shape, boxes = regions.shapes[i], plane.rectangles(regions.box(int(i)))
        if shape is None:
            shapes += [Rectangle((a, low), b - a, high - low) for a, b, low, high in boxes]
            faces += [colour] * len(boxes)
        elif rings := outline(plane, shape):
            closed = [Path(ring, closed=True) for ring in rings]
            shapes.append(PathPatch(Path.make_compound_path(*closed)))
            faces.append(colour)
        if boxes and rank[i] <= TOP and gain[i] > 0:
            _number(axes, boxes[0], float(rank[i]))
    # One collection, as drawing takes a time for each artist.
    axes.add_collection(PatchCollection(shapes, facecolor=faces, edgecolor=_EDGE, linewidth=0.4))
    if demonstrations:
        _draw_paths(axes, plane, demonstrations)
    _dress(axes, plane)
    label = "gain [nat], colours by its square root"
    axes.get_figure(root=True).colorbar(colours, ax=axes, label=label)  # type: ignore[union-attr]
    return axes


def png(axes: Axes) -> bytes:
    """The figure that axes belong to, as a PNG; the same bytes for the same figure."""
    content = io.BytesIO()
    figure: Any = axes.get_figure(root=True)
    figure.savefig(content, format="png", dpi=150, metadata={"Software": None})
    return content.getvalue()


def html_image(axes: Axes) -> str:
    """The figure that axes belong to, as an image of a web page."""
    return (
        '<img alt="map of the hypotheses" src="data:image/png;base64,'
        f'{base64.b64encode(png(axes)).decode()}">'
    )


def _draw_paths(axes: Axes, plane: Plane, demonstrations: Sequence[Demonstration]) -> None:
    """Paths, cut where a dimension goes round."""
    paths = [plane.pieces(demonstration.states) for demonstration in demonstrations]
    pieces = [piece for path in paths for piece in path]
    axes.add_collection(LineCollection(pieces, colors=_PATH, linewidths=0.6, alpha=0.6, zorder=2))
    for marker, ends in (
        ("o", [path[0][0] for path in paths]),
        ("s", [path[-1][-1] for path in paths]),
    ):
        axes.plot(*np.transpose(ends), marker, color=_PATH, markersize=2.5)


def _number(axes: Axes, box: tuple[float, float, float, float], rank: float) -> None:
    """Write a rank into a box."""
    left, right, low, high = box
    plate = {"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "black", "lw": 0.6, "alpha": 0.9}
    place = ((left + right) / 2, (low + high) / 2)
    axes.annotate(f"{rank:g}", place, ha="center", va="center", fontsize=8, bbox=plate, zorder=5)


def _dress(axes: Axes, plane: Plane) -> None:
    """Limits, and labels with units."""
    space = plane.space
    for d, limit, label in (
        (plane.x, axes.set_xlim, axes.set_xlabel),
        (plane.y, axes.set_ylim, axes.set_ylabel),
    ):
        if d is not None:
            limit(space.bounds.lower[d], space.bounds.upper[d])
            unit = f" [{space.units[d]}]" if space.units[d] else ""
            label(f"{space.names[d].replace('_', ' ')}{unit}")
    if plane.y is None:
        axes.set_ylim(0, 1)
        axes.set_yticks([])
