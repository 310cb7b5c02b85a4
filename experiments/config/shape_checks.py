"""What does not match the system: its dimensions, the bounds of its states, its controls.

Each check yields a line for each fault: the key, the value and the way out.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from experiments.config.settings import (
    AdviceSettings,
    GridSettings,
    ModelSettings,
    RecordedSettings,
    Region,
    Settings,
    ShapeList,
    SubjectSettings,
    TableSettings,
    TaskBoxSettings,
)
from mlci.shapes.shape import as_shape, checked_hull
from mlci.spaces import StateSpace


def shape_problems(settings: ModelSettings) -> Iterator[str]:
    """A grid, actions or hypotheses that do not match the system."""
    yield from _grid_problems(settings.grid, settings.model.space)
    yield from _subject_problems(settings)
    yield from _area_problems(settings)


def point_shape_problems(settings: Settings) -> Iterator[str]:
    """A safe set's grid, tasks or a truth that do not match the system."""
    space = settings.model.space
    yield from _length_problems("safety.shape", settings.safety.shape, space)
    yield from _task_region_problems("tasks", settings.tasks, space)
    yield from _listed_problems("truth", settings.truth, space)
    yield from _reality_problems(settings)


def advice_shape_problems(settings: AdviceSettings) -> Iterator[str]:
    """Grids, actions, hypotheses or tasks that do not match the system."""
    space = settings.model.space
    yield from _grid_problems(settings.grid, space)
    for i, shape in enumerate(settings.grids or ()):
        yield from _length_problems(f"grids[{i}]", shape, space)
    yield from _subject_problems(settings)
    yield from _task_region_problems("tasks", settings.tasks, space)


def recorded_shape_problems(settings: RecordedSettings) -> Iterator[str]:
    """Recordings that are not named, and what does not match the system."""
    space = settings.model.space
    yield from _demonstration_problems(settings.demonstrations)
    names = {"units": space.names, "columns": ("time", "states", *space.names)}
    if settings.group_by:  # whose columns may have other names too
        del names["columns"]
    for key, known in names.items():
        for name in getattr(settings, key) or {}:
            if name not in known:
                yield f"{key}: there is no {name}; there are {', '.join(known)}"
    if settings.start is not None:
        yield from _length_problems("start", settings.start, space)
    if settings.goal is not None:
        yield from _region_problems("goal", settings.goal, space, point=True)
    if settings.next_tasks.box is not None:
        yield from _task_region_problems("next_tasks.box", settings.next_tasks.box, space)
    for name, of in (settings.derive or {}).items():
        if name == of or not {name, of} <= set(space.names):
            yield (
                f"derive: {{{name}: {of}}} is no state ({', '.join(space.names)}) as the "
                f"derivative of another; an example is {{{space.names[-1]}: {space.names[0]}}}"
            )


def table_problems(settings: TableSettings) -> Iterator[str]:
    """A world or recordings that are not named."""
    if not settings.table:
        yield "table: empty; name the file of a world, such as table=grid/world.yaml"
    yield from _demonstration_problems(settings.demonstrations)


def _demonstration_problems(given: str | tuple[str, ...]) -> Iterator[str]:
    """Recordings that are not named."""
    if not given or not all([given] if isinstance(given, str) else given):
        yield "demonstrations: empty; name a folder, a pattern or a file"


def _reality_problems(settings: Settings) -> Iterator[str]:
    """A reality in another state space, or lists that do not match states and controls."""
    reality, nominal, real = settings.reality, settings.model, settings.real_system.build()
    space, controls = nominal.space, nominal.control_box.dimension
    for one, other in ((space.bounds, real.space.bounds), (nominal.control_box, real.control_box)):
        if not (np.array_equal(one.lower, other.lower) and np.array_equal(one.upper, other.upper)):
            yield (
                f"reality.system: {dict(reality.system or {})} changes the range of states or "
                "controls; change that in `system`"
            )
            return
    for key, of, entries in (
        ("effort", "state and control", reality.effort),
        ("control_noise", "control", reality.control_noise),
        ("sensor_noise", "state", reality.sensor_noise),
    ):
        number = space.dimension * ("state" in of) + controls * ("control" in of)
        if entries is not None and len(entries) != number:
            yield f"reality.{key}: {list(entries)} must have {number} entries, one a {of}"
        elif key == "effort" and np.any(
            np.array(entries or [0])[: space.dimension] * space.periodic
        ):
            turning = " and ".join(np.array(space.names)[space.periodic])
            yield f"reality.effort: the square of {turning}, which goes round, jumps; price it at 0"


def _grid_problems(grid: GridSettings, space: StateSpace) -> Iterator[str]:
    """Cells that do not match the state space."""
    yield from _length_problems("grid.shape", grid.shape, space)
    yield from _offset_problems(grid.offset, space)


def _subject_problems(settings: SubjectSettings) -> Iterator[str]:
    """Actions and hypotheses that do not match the system."""
    space, controls = settings.model.space, settings.model.control_box.dimension
    if settings.hypotheses.shape is not None:
        yield from _length_problems("hypotheses.shape", settings.hypotheses.shape, space)
    for i, cells in enumerate(settings.hypotheses.grids):
        yield from _length_problems(f"hypotheses.grids[{i}]", cells, space)
    if not isinstance(settings.actions, int) and len(settings.actions) != controls:
        yield f"actions: {list(settings.actions)} must be one number, or a list of {controls}"
    ranges = settings.action_range
    if ranges is not None and (len(ranges) != controls or any(low >= high for low, high in ranges)):
        yield (
            f"action_range: {[list(ends) for ends in ranges]} must be {controls} pairs, each of a "
            "lower and a higher value"
        )
    yield from _listed_problems("hypotheses", settings.hypotheses, space)
    if not settings.hypotheses.shapes_of_grids and not settings.hypotheses.count:
        yield "hypotheses: no shape and no boxes; give a shape, for a grid of cells, or boxes"


def _listed_problems(group: str, listed: ShapeList, space: StateSpace) -> Iterator[str]:
    """Boxes and other regions that cannot be some of the state space."""
    for i, region in enumerate(listed.boxes):
        yield from _region_problems(f"{group}.boxes[{i}]", region, space)
    for key, make in listed.makers():
        if not key.startswith("boxes"):
            try:
                checked_hull(space, as_shape(make()), f"{group}.{key}")
            except ValueError as error:
                where = f"{group}.{key}"
                yield str(error) if str(error).startswith(where) else f"{where}: {error}"


def _area_problems(settings: ModelSettings) -> Iterator[str]:
    """Shapes whose sizes leave nothing to draw, or that no dimension bounds."""
    shapes, cells = settings.inference.shapes, settings.hypotheses.shape
    if shapes.smallest > shapes.largest:
        yield (
            f"inference.shapes.smallest: {shapes.smallest} is above inference.shapes.largest: "
            f"{shapes.largest}; give a smaller one"
        )
    if shapes.count and cells is not None and all(count is None for count in cells):
        yield (
            f"inference.shapes.count: {shapes.count}, but hypotheses.shape leaves every dimension "
            "free, and shapes are bounded where its cells are; set it to 0"
        )


def _offset_problems(offset: tuple[float, ...] | None, space: StateSpace) -> Iterator[str]:
    """Cells can be shifted in periodic dimensions only."""
    if offset is None:
        return
    yield from _length_problems("grid.offset", offset, space)
    for share, periodic, name in zip(offset, space.periodic, space.names, strict=False):
        if share and not periodic:
            yield f"grid.offset: {list(offset)} shifts {name}, which has ends; give it 0"


def _task_region_problems(key: str, tasks: TaskBoxSettings, space: StateSpace) -> Iterator[str]:
    """A box of tasks, or the reach of their goals, that does not fit the state space."""
    yield from _region_problems(key, tasks, space, point=True)
    if tasks.goal is not None:
        yield from _length_problems(f"{key}.goal", tasks.goal, space)


def _length_problems(key: str, entries: tuple[Any, ...], space: StateSpace) -> Iterator[str]:
    """A list must have an entry for each dimension of the state space."""
    if len(entries) != space.dimension:
        names = ", ".join(space.names)
        yield f"{key}: {list(entries)} must have {space.dimension} entries, one each for {names}"


def _region_problems(
    key: str, region: Region, space: StateSpace, point: bool = False
) -> Iterator[str]:
    """A box must match the state space, be ordered and lie inside; some may be a `point`."""
    if len(region.lower) != space.dimension or len(region.upper) != space.dimension:
        yield from _length_problems(f"{key}.lower", region.lower, space)
        yield from _length_problems(f"{key}.upper", region.upper, space)
        return
    for d, (low, high) in enumerate(zip(region.lower, region.upper, strict=True)):
        name, first, last = space.names[d], space.bounds.lower[d], space.bounds.upper[d]
        if low is None and high is None:
            continue
        if low is None or high is None:
            yield f"{key}: {name} has one side only; give both ends, or null twice to leave it free"
        elif low > high or (low == high and not point):
            yield f"{key}: {name} goes from {low} to {high}; lower must be below upper"
        elif space.periodic[d] and high - low > (last - first) * (1 + 1e-12):
            yield f"{key}: {name} from {low:.6g} to {high:.6g} is over a whole turn; use null twice"
        elif not space.periodic[d] and (low < first or high > last):
            yield (
                f"{key}: {name} from {low:.6g} to {high:.6g} leaves the state space "
                f"[{first:.6g}, {last:.6g}]; move it inside, or choose another {key.split('.')[0]}"
            )
