"""The benchmark end to end with the README's own world and method, its scores and its worlds."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.field.__main__ import main
from experiments.field.catalog import load
from experiments.field.contest import contest
from experiments.field.entries import Answer
from experiments.field.leaderboard import interval, standings
from experiments.field.ours import NEVER, most_overlap, ranked, sets
from experiments.field.scores import SCORES, score
from experiments.field.worlds import mazes, plane, scobee, walls
from experiments.field.worlds.grids import MOVES, entering, grid_case, slippery, successors
from mlci.evidence import Rates
from mlci.rivals.agent import Agent
from mlci.rivals.set_gains import set_gains, single_avoidance
from mlci.sets.posterior import SetPosterior
from mlci.spaces import Bools
from mlci.worlds.tables import Table

README = Path(__file__).parents[3] / "experiments" / "field" / "README.md"
QUICK = ["ours: single", "paper as printed", "visitation difference", "middle"]


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the README's example."""
    path = tmp_path_factory.mktemp("field") / "mine.py"
    path.write_text(re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)[0])
    return path


def without_time(table: Path) -> pd.DataFrame:
    """A table of runs but for what a clock says."""
    return pd.read_csv(table).drop(columns="seconds")


def test_the_example_of_the_readme_is_short_and_leads_to_a_leaderboard(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(mine.read_text().splitlines()) < 60
    folder = tmp_path / "a"
    arguments = ["--add", str(mine), "--worlds", "row", "--seeds", "2", "--workers", "1"]
    assert main([*arguments, "--methods", *QUICK, "--out", str(folder)]) == 0
    assert str(folder / "LEADERBOARD.md") in capsys.readouterr().out
    page = (folder / "LEADERBOARD.md").read_text()
    assert "| row | mine | 10 | 6 moves | nothing is published |" in page
    assert (folder / "leaderboard.png").read_bytes().startswith(b"\x89PNG")
    board = pd.read_csv(folder / "tables" / "leaderboard.csv").set_index(["method", "score"])
    assert board.loc[("middle", "iou"), "mean"] == 1  # the middle one is forbidden
    assert board.loc[("ours: single", "rank"), "mean"] == 1

    # What is done is not done again, and one method more is done alone; order does not matter.
    kept = {path: path.stat().st_mtime_ns for path in folder.rglob("*.json")}
    assert main([*arguments, "--methods", *QUICK, "uniform", "--out", str(folder)]) == 0
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert len(list(folder.rglob("*.json"))) == len(kept) + 2
    other = tmp_path / "b"
    assert main([*arguments, "--methods", "uniform", *QUICK, "--out", str(other)]) == 0
    first, second = (without_time(where / "tables" / "runs.csv") for where in (folder, other))
    pd.testing.assert_frame_equal(first, second)


def test_changed_code_is_run_again(mine: Path, tmp_path: Path) -> None:
    added = tmp_path / "changed.py"
    for forbidden, iou in (("[3]", 1.0), ("[2]", 0.0)):  # the middle one, and its neighbour
        added.write_text(mine.read_text().replace("[3]", forbidden))
        load.cache_clear()
        runs = contest(tmp_path, ["row"], ["middle"], [0], (added,))
        assert runs["iou"].tolist() == [iou]


def test_mistakes_are_told(mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty = tmp_path / "empty.py"
    empty.write_text("")
    (tmp_path / "folder").mkdir()
    for arguments, message in (
        (["--worlds", "moon"], "no world is called moon"),
        (["--methods", "luck"], "no method is called luck"),
        (["--add", str(empty)], "neither WORLDS nor METHODS"),
        (["--add", str(tmp_path / "none.py")], "no Python file"),
        (["--add", str(mine), str(mine)], "is there already"),
        (["--add", str(tmp_path / "folder")], "world.yaml"),
    ):
        assert main([*arguments, "--out", str(tmp_path / "r")]) == 2
        assert message in capsys.readouterr().err


def test_recordings_of_a_folder_are_a_world(tmp_path: Path) -> None:
    lines = ["lower: [0, 0]", "upper: [1, 1]", "speed: 1", "dt: 0.2", "temperature: 0.02"]
    lines += ["source: drawn by hand", "forbidden: [{center: [0.5, 0.5], radii: [0.1, 0.1]}]"]
    (tmp_path / "world.yaml").write_text("\n".join(lines))
    time = np.linspace(0, 1, 21)
    for name, bend in (("up", 0.25), ("down", -0.25)):
        y = 0.5 + bend * np.sin(np.pi * time)
        frame = pd.DataFrame({"time": time, "x": 0.1 + 0.8 * time, "y": y})
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    world = load((tmp_path,)).worlds[f"recorded: {tmp_path.name}"]
    case = world.make(0, 20)
    assert len(case.problem.shown) == 2
    runs = contest(tmp_path / "r", [f"recorded: {tmp_path.name}"], ["uniform"], [0], (tmp_path,))
    assert runs["demonstrations"].tolist() == [2]  # as many as there are, of 20 that are asked for
    assert np.flatnonzero(case.cover > 0.1).tolist() == [44, 45, 54, 55]
    assert not case.problem.violated[:, case.cover > 0.1].any()
    up, down = (each.violated for each in case.problem.shown)  # across y = 0.75 or 0.25 halfway
    assert {bool(up[57]), bool(down[57])} == {bool(up[52]), bool(down[52])} == {False, True}


def test_scores_by_hand() -> None:
    case = walls.WORLDS["walls S3"].make(1, 3)
    truth = case.truth
    assert np.flatnonzero(truth).tolist() == [21, 22, 23, 24, 25]
    rng = np.random.default_rng(0)
    half = truth & (np.arange(49) < 23)  # two of five
    probability = np.where(half, 0.9, np.where(truth, 0.5, 0.1))
    answer = Answer(np.where(half, 2.0, truth * 1.0), half | (np.arange(49) == 0), probability)
    scores = score(case, answer, rng)
    assert scores["iou"] == pytest.approx(2 / 6)
    assert scores["precision"] == pytest.approx(2 / 3)
    assert scores["recall"] == pytest.approx(2 / 5)
    assert scores["rank"] == 1.5  # two share the first rank
    assert scores["top"] == 1
    log_posterior = 46 * np.log(0.9) + 3 * np.log(0.5)
    assert scores["log_posterior"] == pytest.approx(log_posterior)
    assert scores["calibration"] == pytest.approx(-0.1)
    one = score(case, Answer(np.where(np.arange(49) == 21, 0.0, -np.inf)), rng)
    assert (one["top"], one["precision"], one["recall"]) == pytest.approx((1 / 5, 1, 1 / 5))
    knows = score(case, Answer(truth.astype(float), truth), rng)
    assert knows["violations"] == pytest.approx(0, abs=1e-12)
    assert knows["reward_lost"] == pytest.approx(0, abs=1e-9)
    ignores = score(case, Answer(truth.astype(float), np.zeros(49, dtype=bool)), rng)
    assert ignores["violations"] > 0.9
    assert ignores["reward_lost"] < -1  # the way through the wall is shorter
    blocked = score(case, Answer(truth.astype(float), ~np.eye(49, dtype=bool)[0]), rng)
    assert blocked["stuck"] == 1
    assert np.isnan(blocked["reward_lost"])
    claimed = score(case, Answer(truth.astype(float), claimed=0.3), rng)
    assert claimed["calibration"] == pytest.approx(0.3 - 1)
    in_part = replace(case, cover=np.where(truth, 0.8, 0.0) + 0.3 * (np.arange(49) == 0))
    scores_in_part = score(in_part, Answer(truth.astype(float), truth), rng)
    assert scores_in_part["recall"] == pytest.approx(4 / 4.3)
    assert scores_in_part["iou"] == pytest.approx(4 / 5.3)
    nothing = replace(case, cover=np.zeros(49))
    assert score(nothing, Answer(np.zeros(49), np.zeros(49, dtype=bool)), rng)["iou"] == 1
    assert SCORES.keys() == scores.keys() | {"seconds"}


def test_what_only_scores_takes_as_many_as_are_true_with_ties_at_random() -> None:
    case = walls.WORLDS["walls S3"].make(1, 3)
    flat = [score(case, Answer(np.zeros(49)), np.random.default_rng(k)) for k in range(40)]
    share = [each["precision"] for each in flat]
    assert np.mean(share) == pytest.approx(5 / 49, abs=4 * np.std(share) / np.sqrt(40))
    assert {each["precision"] == each["recall"] for each in flat} == {True}


def test_slips_are_as_published() -> None:
    meant = successors((7, 7))
    chances = slippery(meant, 0.05)
    inner = 3 * 7 + 3
    assert sorted(chances[inner, 0][chances[inner, 0] > 0]) == pytest.approx(
        [0.05 / 8] * 7 + [0.95 + 0.05 / 8]
    )
    corner = chances[0][meant[0] >= 0]  # three moves stay on the grid
    left = 0.95 + 3 * 0.05 / 8
    assert corner.max(axis=1) == pytest.approx([(0.95 + 0.05 / 8) / left] * 3)
    assert np.sum(chances, axis=2)[meant < 0].tolist() == [0] * int(np.sum(meant < 0))
    assert len(MOVES) == 8


def test_every_truth_has_a_way_round_and_matters() -> None:
    for world in (*walls.WORLDS.values(), *mazes.WORLDS.values(), *scobee.WORLDS.values()):
        case = world.make(0, 1)
        ((agent, _),) = case.problem.tasks
        assert agent.under(case.truth).keeps_out(case.forbidden) == pytest.approx(1)
        assert agent.keeps_out(case.forbidden) < 0.5
        assert not case.problem.violated[:, case.truth].any()


def test_the_cells_of_a_continuous_world_can_do_what_people_did() -> None:
    case = plane.WORLDS["disc"].make(0, 4)
    assert all(agent.is_possible for agent, _ in case.problem.tasks)
    assert np.sum(case.cover) == pytest.approx(np.pi, rel=0.05)  # in hypotheses of 0.1 x 0.1
    alpha = single_avoidance(case.problem)
    assert np.min(alpha[:, case.truth]) < 0.5


def test_intervals_and_standings_by_hand() -> None:
    assert interval(np.array([1.0, 2.0, 3.0]))["upper"] == pytest.approx(2 + 4.302653 / np.sqrt(3))
    means = {"ours: sets": 0.5, "ours: ranked": 0.55, "ours: greedy": 0.9}
    means |= {"other": 0.3, "worse": 0.2, "told": 0.6}
    rows = [
        {"world": "w", "method": method, "seed": seed, "iou": iou + 0.01 * seed}
        for method, iou in means.items()
        for seed in range(3)
    ]
    untold, told = standings(pd.DataFrame(rows), "iou", {"told", "ours: ranked"}).to_dict("records")
    assert (untold["ours"], untold["other"], untold["verdict"]) == ("ours: sets", "other", "ahead")
    assert untold["ahead"] == pytest.approx(0.2)
    assert (told["ours"], told["other"], told["verdict"]) == ("ours: ranked", "told", "behind")
    assert told["ahead"] == pytest.approx(-0.05)
    alone = standings(pd.DataFrame(rows[::3]), "iou", {"told", "ours: ranked"})
    assert alone["verdict"].tolist() == ["unknown", "unknown"]  # one seed has no interval
    assert standings(pd.DataFrame(rows[6:]), "iou", {"told"}).empty  # of ours, greedy alone


def test_the_expected_overlap_is_largest() -> None:
    members = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [1, 1, 0, 0], [0, 1, 1, 1]], dtype=bool)
    firsts = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 1, 0], [1, 1, 1, 1]]) > 0
    for probability in ([0.5, 0.3, 0.1, 0.1], [0.3, 0.4, 0.2, 0.1], [0, 0.3, 0.5, 0.2]):
        belief = SetPosterior(members, np.array(probability), np.zeros(4), np.zeros(4))

        def overlap(chosen: Bools, belief: SetPosterior = belief) -> float:
            each = [
                np.sum(true & chosen) / np.sum(true | chosen) if np.any(true | chosen) else 1.0
                for true in members
            ]
            return float(np.dot(belief.probability, each))

        best = max(firsts, key=overlap)
        assert most_overlap(belief).tolist() == best.tolist()


def test_the_inside_that_nobody_can_enter_is_forbidden_with_its_border() -> None:
    meant = successors((5, 5))
    table = Table.from_arrays(meant, -1.0, 0, 24, entering(meant, np.arange(25)[:, None]))
    block = [6, 7, 8, 11, 12, 13, 16, 17, 18]
    case = grid_case(Agent(table, 8, final=table.goals), (5, 5), block, 0, 20)
    rng = np.random.default_rng(0)
    gain = set_gains(case.problem, Rates(NEVER)).gain
    hollow = case.truth & (np.arange(25) != 12)
    assert gain(hollow) == pytest.approx(gain(case.truth))  # the middle explains nothing more
    assert sets(case.problem, rng).chosen[12]
    told = ranked(case.problem, rng)
    assert told.chosen is None
    assert score(case, told, rng)["iou"] == 1
    assert np.all(told.scores[~case.problem.feasible] == -np.inf)
    few = grid_case(Agent(table, 8, final=table.goals), (5, 5), [], 0, 1)  # which say little
    first = ranked(few.problem, rng).scores
    alone = set_gains(few.problem, Rates(NEVER)).beside(np.zeros(25, dtype=bool))
    assert not np.any(sets(few.problem, rng).chosen)
    feasible = few.problem.feasible
    assert np.all(np.diff(alone[feasible][np.argsort(first[feasible])]) >= -1e-12)


def test_files_that_are_no_entries_are_told(tmp_path: Path) -> None:
    entry = "from experiments.field.entries import Method\nMETHODS = {{{!r}: Method(None, '')}}"
    for text, message in (
        ("def f(:", "SyntaxError"),
        ("x = 1\nraise KeyError('boom')", "line 2 fails: KeyError: 'boom'"),
        ("import sys; sys.exit(0)", "SystemExit"),
        ("WORLDS = [1]", "WORLDS must be a dictionary by names, not a list"),
        ("WORLDS = {'odd': 3}", "WORLDS['odd'] must be a World, not a int"),
        (entry.format("a/../b"), "names no folder of results"),
        (entry.format("ours greedy"), "ours: greedy is there already"),
    ):
        path = tmp_path / "entry.py"
        path.write_text(text)
        load.cache_clear()
        with pytest.raises(ValueError, match=re.escape(message)):
            load((path,))
    path.write_bytes(b"\xff\xfe")
    load.cache_clear()
    with pytest.raises(ValueError, match=r"entry\.py fails: UnicodeDecodeError"):
        load((path,))


def test_files_of_one_name_are_told_apart(mine: Path, tmp_path: Path) -> None:
    paths = []
    for word in ("left", "right"):
        path = tmp_path / word / "entry.py"
        path.parent.mkdir()
        path.write_text(mine.read_text().replace('"row"', f'"{word}"').replace("middle", word))
        paths.append(path)
    catalog = load(tuple(paths))
    assert len(catalog.added) == 2
    assert catalog.worlds["left"].make(0, 2).cover.shape == (7,)
    sources = {catalog.source(catalog.methods[word].answer) for word in ("left", "right")}
    assert len(sources) == 2


def test_changed_recordings_are_run_again_and_folders_of_one_name_are_refused(
    tmp_path: Path,
) -> None:
    lines = ["lower: [0, 0]", "upper: [1, 1]", "speed: 1", "dt: 0.2", "temperature: 0.02"]
    lines += ["source: nobody", "forbidden: []"]
    folders = [tmp_path / word / "lab" for word in ("a", "b")]
    for folder in folders:
        folder.mkdir(parents=True)
        (folder / "world.yaml").write_text("\n".join(lines))
    with pytest.raises(ValueError, match="recorded: lab is there already"):
        load(tuple(folders))
    sources = set()
    for text in ("time,x,y\n0,0,0\n1,1,1\n", "time,x,y\n0,0,0\n1,0.5,1\n"):
        (folders[0] / "path.csv").write_text(text)
        load.cache_clear()
        catalog = load((folders[0],))
        sources.add(catalog.source(catalog.worlds["recorded: lab"].make))
    assert len(sources) == 2
    for old, new, message in (
        ("speed: 1", "speed: fast", "speed must be a number above 0, not 'fast'"),
        ("temperature: 0.02", "temperature: .nan", "temperature must be a number above 0"),
        ("forbidden: []", "forbidden: [{centre: [0, 0]}]", "{center, radii} or {lower, upper}"),
        ("lower: [0, 0]", "lower: [0]", "two corners"),
    ):
        (folders[0] / "world.yaml").write_text("\n".join(lines).replace(old, new))
        load.cache_clear()
        with pytest.raises(ValueError, match=re.escape(message)):
            load((folders[0],))


def test_answers_that_say_nothing_are_refused(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, scores = mine.read_text(), "Answer(scores, chosen=scores == scores.max())"
    assert scores in text
    for answer, message in (
        ("Answer(scores * np.nan)", "its scores are NaN for hypothesis 0"),
        ("Answer(scores[1:])", "its scores must be numbers, one of each of 7 hypotheses"),
        ("Answer(scores, chosen=[3])", "its chosen must be truth values"),
        ("Answer(scores, probability=scores)", "between 0 and 1"),
        ("scores", "it must return an Answer, not a ndarray"),
    ):
        path = tmp_path / "answers.py"
        path.write_text(text.replace(scores, answer))
        load.cache_clear()
        arguments = ["--add", str(path), "--worlds", "row", "--methods", "middle", "--seeds", "1"]
        assert main([*arguments, "--workers", "1", "--out", str(tmp_path / "r")]) == 2
        told = capsys.readouterr().err
        assert "method middle in world row, seed 0" in told
        assert message in told
    for wrong in (["--workers", "0"], ["--out", str(path)]):
        with pytest.raises(SystemExit):
            main(wrong)


def test_no_demonstrations_and_a_folder_that_cannot_be_written_are_refused_before_any_world(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    arguments = ["--add", str(mine), "--worlds", "row", "--methods", "middle", "--seeds", "1"]
    for wrong, message in (
        (["--demonstrations", "0"], "--demonstrations are at least 1"),
        (["--out", str(tmp_path / "file" / "r")], "--out: nothing can be written into"),
    ):
        with pytest.raises(SystemExit) as stopped:
            main([*arguments, "--workers", "1", "--out", str(tmp_path / "r"), *wrong])
        assert stopped.value.code == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "r").exists()


def test_a_method_that_ends_the_program_has_failed(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ending, rule = tmp_path / "ending.py", "scores = -np.abs(place - place.mean())"
    ending.write_text(mine.read_text().replace(rule, "raise SystemExit(0)"))
    arguments = ["--add", str(ending), "--worlds", "row", "--methods", "middle", "--seeds", "1"]
    assert main([*arguments, "--workers", "1", "--out", str(tmp_path / "r")]) == 2
    assert "method middle in world row, seed 0 fails: SystemExit" in capsys.readouterr().err


def test_a_method_that_fails_is_named_and_the_others_go_on(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.py"
    rule = "scores = -np.abs(place - place.mean())"
    assert rule in mine.read_text()
    broken.write_text(mine.read_text().replace(rule, "scores = place[99]"))
    arguments = ["--add", str(broken), "--worlds", "row", "--seeds", "2", "--workers", "1"]
    out = ["--out", str(tmp_path / "r")]
    assert main([*arguments, "--methods", "middle", "uniform", *out]) == 2
    told = capsys.readouterr().err
    assert "method middle in world row, seed 0 fails: " in told
    assert "; so do 1 more" in told
    assert "broken.py, line" in told
    assert len(told.splitlines()) == 1
    assert len(list((tmp_path / "r").rglob("*.json"))) == 2  # of uniform, with both seeds
    broken.write_text(mine.read_text().replace("[3], seed", "[1, 2], seed"))  # no way
    load.cache_clear()
    assert main([*arguments, "--methods", "uniform", "--out", str(tmp_path / "s")]) == 2
    assert "world row, seed 0 fails: ValueError: " in capsys.readouterr().err


def test_two_workers_write_what_one_does(mine: Path, tmp_path: Path) -> None:
    tables = []
    for workers in ("1", "2"):
        arguments = ["--add", str(mine), "--worlds", "row", "maze 3", "--demonstrations", "3"]
        arguments += ["--methods", "ours: greedy", "sampled crossings", "--seeds", "2"]
        assert main([*arguments, "--workers", workers, "--out", str(tmp_path / workers)]) == 0
        tables.append(without_time(tmp_path / workers / "tables" / "runs.csv"))
    pd.testing.assert_frame_equal(*tables)
    assert set(tables[0]["demonstrations"]) == {3}
    assert "| maze 3 | our own | 3 | horizon" in (tmp_path / "1" / "LEADERBOARD.md").read_text()
