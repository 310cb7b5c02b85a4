"""Recorded demonstrations as the settings say, and doubts about them."""

from __future__ import annotations

from collections.abc import Sequence

from experiments.config.problems import ConfigError
from experiments.config.settings import RecordedSettings
from experiments.progress import begin
from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.maxent import ROUNDED_TIMES
from mlci.models import Model
from mlci.recordings.paths import Repair
from mlci.recordings.plausibility import Plausibility, plausibility
from mlci.recordings.read import Readings, read_demonstrations
from mlci.recordings.recording import Remark
from mlci.recordings.task_table import Ends, read_task_table
from mlci.recordings.times import refuse_long
from mlci.soft.weight import WeightEstimate, best_forgiven, estimate_weights
from mlci.spaces import StateSpace
from mlci.tabular import TabularModel

_OVERSTATED = (
    "shallow or short crossings of the recordings do not count, but those of the tabular model do: "
    "the evidence is slightly overstated; inference.calibrate=true corrects that"
)


def read_recordings(settings: RecordedSettings) -> Readings:
    """The demonstrations that can be used, what is wrong with other files, and what was assumed.

    Raises:
        ConfigError: a table of tasks that cannot be used.
    """
    space = settings.model.space
    tasks = None if settings.tasks is None else task_table("tasks", settings.tasks, space)
    group_by = settings.group_by or ()
    readings = read_demonstrations(
        settings.demonstrations,
        settings.model,
        dt=settings.recorded_dt,
        columns=settings.columns,
        units=settings.units,
        time_unit=settings.time_unit,
        group_by=[group_by] if isinstance(group_by, str) else group_by,
        repair=Repair(
            settings.bridge * settings.cells.widths, settings.derive or {}, settings.derive_window
        ),
        tasks=tasks,
        start=settings.start,
        goal=None if settings.goal is None else settings.goal.box(),
        max_memory=settings.max_memory,
    )
    usable, dt = [], settings.dt
    for demonstration in readings.demonstrations:
        duration, name = demonstration.task.horizon, demonstration.name
        try:
            refuse_long(duration, dt, settings.max_duration)
        except ValueError as error:
            readings.problems.append(Remark(name, str(error)))
            continue
        usable.append(demonstration)
        steps = max(1, round(duration / dt))
        if abs(duration / dt - steps) > ROUNDED_TIMES:
            message = f"its {duration:g} s count as {steps} steps of {dt:g} s, {steps * dt:g} s"
            readings.notes.append(Remark(name, message))
    if usable and not (settings.inference.calibrate or settings.crossing.crossing().is_any):
        readings.notes.append(Remark("crossing", _OVERSTATED))
    return readings._replace(demonstrations=usable)


def task_table(key: str, file: str, space: StateSpace) -> dict[str, Ends]:
    """The tasks of a table that an option names.

    Raises:
        ConfigError: a table that is not there or cannot be used; the message begins with the key.
    """
    try:
        return read_task_table(file, space)
    except OSError as error:
        raise ConfigError(f"{key}: {file}: {error.strerror or error}") from None
    except ValueError as error:
        raise ConfigError(f"{key}: {error}") from None


def plausibilities(
    settings: RecordedSettings, demonstrations: Sequence[Demonstration]
) -> list[Plausibility]:
    """What is known of each recording from itself."""
    crossing = settings.crossing.crossing()
    return [
        plausibility(settings.model, settings.candidates, each, crossing) for each in demonstrations
    ]


def recorded_weights(
    settings: RecordedSettings,
    model: Model,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
) -> list[WeightEstimate]:
    """Soft or hard? The weights of so many regions as the settings ask for."""
    if not settings.soft or not isinstance(model, TabularModel):
        return []
    begin("soft or hard?")
    return estimate_weights(
        model,
        demonstrations,
        inference,
        regions=best_forgiven(inference, settings.soft),
        round_horizon=True,
        exact_ends=settings.inference.exact_ends,
    )


def together(remarks: Sequence[Remark]) -> list[str]:
    """Remarks as lines, those of the same words in one."""
    files: dict[str, list[str]] = {}
    for remark in remarks:
        files.setdefault(remark.message, []).append(remark.file)
    return [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {message}"
        for message, names in files.items()
    ]
