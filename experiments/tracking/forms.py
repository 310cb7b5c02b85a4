"""The form of what is read of points and studies, as far as readers count on it.

A file that carries its own digest is as somebody wrote it, which need not be as points and sweeps
write theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.tracking.study import Study, whole_study

_DEEPEST = 60  # levels of a tree; those of records are ten
_NUMBER = (int, float)
_RECORD: Mapping[str, Any] = {
    "config": dict,
    "source": str,
    "started": str,
    "seconds": {"total": _NUMBER},
    "git": {"commit": (str, type(None))},
}


def record_fault(record: Mapping[str, Any]) -> str | None:
    """What keeps a record from being one of a point's; None if nothing does."""
    if is_deep(record):
        return "it nests too deep"
    if (key := _first_odd(record, _RECORD)) is not None:
        return f"its {key} is missing, or of another kind"
    if not isinstance(record.get("attempt", 1), int):
        return "its attempt is no number"
    return None


def study_fault(study: Study) -> str | None:
    """What keeps a study's listing from being one of a sweep's; None if nothing does."""
    collated = study.collated
    kinds: dict[str, bool] = {
        "points": all(map(_is_texts, study.points.values())),
        "examples": isinstance(study.examples, Mapping) and not is_deep(study.examples),
    }
    if collated is not None:
        kinds |= {
            **{
                name: _is_texts(getattr(collated, name))
                for name in ("systems", "commits", "versions", "kept", "machines")
            },
            "started": _is_texts(collated.started) and len(collated.started) == 2,
            "sources": isinstance(collated.sources, Mapping)
            and all(isinstance(count, int) for count in collated.sources.values()),
            "made_by": isinstance(collated.made_by, str),
            "made_of": isinstance(collated.made_of, str),
            "seconds": isinstance(collated.seconds, _NUMBER),
            "peak_memory_mb": isinstance(collated.peak_memory_mb, _NUMBER),
            "attempts": isinstance(collated.attempts, tuple)
            and all(isinstance(number, int) for number in collated.attempts),
        }
    odd = [key for key, is_right in kinds.items() if not is_right]
    return f"its {', '.join(odd)}: of another kind than a sweep writes" if odd else None


def sound_study(folder: Any) -> Study | None:
    """The study of a folder, or None if there is none that is whole and of its form."""
    study = whole_study(folder)
    return None if study is None or study_fault(study) else study


def is_deep(tree: object) -> bool:
    """Whether plain nested values nest deeper than anything that is written here."""
    level = [tree]
    for _ in range(_DEEPEST):
        level = [inner for outer in level for inner in _inside(outer)]
        if not level:
            return False
    return True


def _inside(value: object) -> Sequence[object]:
    """What a value of a tree holds."""
    if isinstance(value, Mapping):
        return list(value.values())
    return value if isinstance(value, list | tuple) else ()


def _is_texts(value: object) -> bool:
    """Whether something is a tuple of texts."""
    return isinstance(value, tuple) and all(isinstance(part, str) for part in value)


def _first_odd(tree: Mapping[str, Any], form: Mapping[str, Any]) -> str | None:
    """The dotted key of the first value that is not of its form; None if all are."""
    for key, kinds in form.items():
        value = tree.get(key, ...)
        if not isinstance(kinds, Mapping):
            if not isinstance(value, kinds):
                return key
        elif not isinstance(value, Mapping):
            return key
        elif (inner := _first_odd(value, kinds)) is not None:
            return f"{key}.{inner}"
    return None
