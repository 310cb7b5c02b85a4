"""What a sweep says about wrong configs and failed points."""

from pathlib import Path

from experiments.sweep.messages import describe_failures, describe_problems
from experiments.sweep.plan import PlannedPoint
from experiments.sweep.runner import Outcome
from experiments.tracking.points import Point, State


def planned(name: str) -> PlannedPoint:
    return PlannedPoint(
        (name,), name, Point(Path("results"), f"of_{name}".replace(" ", "_")), State.MISSING
    )


def test_problem_is_told_once_with_the_points_that_have_it() -> None:
    problems = {"dt: too long": ["a", "b"], "seed: not whole": ["b"]}
    assert describe_problems(problems, 2).splitlines() == [
        "dt: too long [all points]",
        "seed: not whole [1 of 2 points, such as b]",
    ]
    assert describe_problems({"dt: too long": ["a"]}, 1) == "dt: too long"


def test_failures_share_equal_tracebacks_and_have_a_line_each() -> None:
    failures = [
        (planned("a"), {"reason": "raised", "error": "E: x", "traceback": "where\n"}),
        (planned("long name"), {"reason": "died", "error": "killed", "traceback": ""}),
        (planned("c"), {"reason": "raised", "error": "E: y", "traceback": "where\n"}),
    ]
    lines = describe_failures(Outcome(failures, [planned("d")]), 9).splitlines()
    assert lines == [
        "--- a (and 1 more): results/points/of_a/log.txt",
        "where",
        "--- long name: results/points/of_long_name/log.txt",
        "3 of 9 points failed, and no table is written; the others are kept, and the same command "
        "runs what is missing:",
        "  raised  a          E: x",
        "  died    long name  killed",
        "  raised  c          E: y",
        "not started: 1 point",
    ]
    assert describe_failures(Outcome(failures, []), 9).splitlines() == lines[:-1]
