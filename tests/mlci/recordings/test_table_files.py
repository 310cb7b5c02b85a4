"""Files of moves and of paths of a finite world: what they hold, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from mlci.recordings.moves import read_moves
from mlci.recordings.table_paths import read_table_paths
from mlci.worlds.tables import Table

# A corridor from hall to yard, with a door that may stay shut.
MOVES = """# the house
State; Action; Next; Probability; Reward
hall; go; door; 1; -1
door; push; yard; 0.8; -2
door; push; door; 0.2; -2
door; back; hall; 1; -1
"""


def written(folder: Path, content: str, name: str = "file.csv") -> Path:
    file = folder / name
    file.write_text(content)
    return file


def test_text_holds_moves_by_name(tmp_path: Path) -> None:
    moves = read_moves(written(tmp_path, MOVES))
    assert moves.states == ("hall", "door", "yard")
    assert moves.actions == ("go", "push", "back")
    dense = moves.transitions.toarray().reshape(3, 3, 3)
    assert dense[0, 0].tolist() == [0, 1, 0]
    assert dense[1, 1].tolist() == [0, 0.2, 0.8]
    assert dense.sum() == 3
    assert moves.reward is not None
    assert moves.reward.tolist() == [[-1, 0, 0], [0, -2, -1], [0, 0, 0]]


def test_numbers_are_in_order_of_size_whatever_their_rows(tmp_path: Path) -> None:
    moves = read_moves(written(tmp_path, "state,action,next\n10,1,2.0\n02,0,10\n"))
    assert (moves.states, moves.actions) == (("2", "10"), ("0", "1"))
    assert moves.reward is None
    assert moves.transitions.toarray().reshape(2, 2, 2)[0, 0].tolist() == [0, 1]


def test_arrays_hold_the_same_as_text(tmp_path: Path) -> None:
    text = read_moves(written(tmp_path, "state,action,next,reward\n0,0,1,-1\n1,1,0,-2\n"))
    successor = np.array([[1, -1], [-1, 0]])
    reward = np.array([[-1.0, 0.0], [0.0, -2.0]])
    np.savez(tmp_path / "successor.npz", successor=successor, reward=reward)
    np.savez(tmp_path / "chances.npz", transitions=text.transitions.toarray().reshape(2, 2, 2))
    sparse.save_npz(tmp_path / "sparse.npz", text.transitions)
    for name in ("successor", "chances", "sparse"):
        moves = read_moves(tmp_path / f"{name}.npz")
        assert (moves.transitions != text.transitions).nnz == 0
        assert moves.states == ("0", "1")
    assert np.array_equal(read_moves(tmp_path / "successor.npz").reward, reward)  # type: ignore[arg-type]
    assert read_moves(tmp_path / "sparse.npz", ["a", "b"]).states == ("a", "b")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        ("state,action\n0,1\n", "line 1 must name the columns state, action, next; next is not"),
        ("state,action,next\n", "has no move below its header"),
        ("state,action,next\n0,1\n", "line 2 has 2 values where the header has 3"),
        ("state,action,next\n0,,1\n", "line 2: action is empty"),
        ("state,action,next\n0,0,1\n0,0,1\n", "line 3 tells the same move to the same state as"),
        ("state,action,next\n0,0,1\n0,0,0\n", "line 2: probabilities of what follows action '0' "),
        ("state,action,next,probability\n0,0,1,p\n", "line 2: probability 'p' is not a finite"),
        ("state,action,next,probability\n0,0,1,.5\n0,0,0,.4\n", "add up to 0.9, not 1"),
        (
            "state,action,next,probability,reward\n0,0,1,.5,1\n0,0,0,.5,2\n",
            "line 2: rewards of one move differ",
        ),
    ],
)
def test_moves_that_cannot_be_read(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_moves(written(tmp_path, content))


def test_other_faults_of_files_of_moves(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no such file"):
        read_moves(tmp_path / "none.csv")
    with pytest.raises(ValueError, match="there is no such file"):
        read_moves(tmp_path / "none.npz")
    with pytest.raises(ValueError, match=r"is damaged, or no \.npz file"):
        read_moves(written(tmp_path, "text", "text.npz"))
    np.savez(tmp_path / "other.npz", matrix=np.eye(2))
    with pytest.raises(ValueError, match=r"needs an array successor .* it holds matrix"):
        read_moves(tmp_path / "other.npz")
    np.savez(tmp_path / "one.npz", successor=np.array([[0]]), reward=np.zeros(3))
    with pytest.raises(ValueError, match=r"a reward \(3,\) that does not suit \(1, 1\)"):
        read_moves(tmp_path / "one.npz")
    with pytest.raises(ValueError, match="has 1 states, and 2 are named"):
        read_moves(tmp_path / "one.npz", ["a", "b"])
    file = written(tmp_path, MOVES)
    with pytest.raises(ValueError, match="line 4: there is no state 'door' among the 2 that are"):
        read_moves(file, ["hall", "yard"])
    with pytest.raises(ValueError, match="states must have different names, and 'hall' stands"):
        read_moves(file, ["hall", "Hall", "yard"])


NAMES = ("hall", "door", "yard"), ("go", "push", "back")


def house(tmp_path: Path) -> Table:
    moves = read_moves(written(tmp_path, MOVES, "moves.txt"))
    assert moves.reward is not None
    return Table.from_arrays(moves.transitions, moves.reward, 0, 2)


def test_paths_are_read_by_file_and_trial(tmp_path: Path) -> None:
    table = house(tmp_path)
    written(tmp_path, "state,action\nhall,go\ndoor,push\ndoor,push\nyard,\n", "a.csv")
    rows = "trial\tState\tAction\tnote\n2\thall\tgo\tx\n1\thall\tgo\t\n2\tdoor\tpush\t\n"
    written(tmp_path, rows + "1\tdoor\tpush\t\n2\tyard\t\t\n1\tyard\t\tend\n", "b.tsv")
    files = [tmp_path / "a.csv", tmp_path / "b.tsv"]
    paths, problems = read_table_paths(files, table, *NAMES)
    assert not problems
    assert [path.name for path in paths] == ["a", "b_2", "b_1"]
    assert paths[0].states.tolist() == [0, 1, 1, 2]
    assert paths[0].actions.tolist() == [0, 1, 1]
    assert paths[1].states.tolist() == [0, 1, 2]


def test_the_state_after_the_last_action_is_added_where_it_is_certain(tmp_path: Path) -> None:
    table = Table.from_arrays(np.array([[1], [2], [-1]]), -1.0, 0, 2)
    paths, problems = read_table_paths(written(tmp_path, "state,action\n0,0\n1,0\n"), table)
    assert not problems
    assert paths[0].states.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("", "has no step below its header"),
        ("hall,", "line 2: the path has no action"),
        ("cellar,go\ndoor,push\nyard,", "line 2: there is no state 'cellar'; there are hall, door"),
        ("hall,fly\ndoor,push\nyard,", "line 2: there is no action 'fly'; there are go, push"),
        ("hall,go\ndoor,\ndoor,push\nyard,", "line 3: has no action; only the last row of a path"),
        ("hall,push\nyard,", "line 2: action 'push' in state 'hall' is no move of the world"),
        ("hall,go\nyard,", "line 2: action 'go' in state 'hall' never leads to state 'yard'"),
        ("door,push\nyard,", "line 2: the path begins in state 'door', where the world does not"),
        ("hall,go\ndoor,", "line 3: the path ends in state 'door', which is no goal; goals are 'y"),
        ("hall,go\ndoor,push", "line 3: action 'push' in state 'door' leads where chance decides"),
        (
            "hall,go\ndoor,push\nyard,go\nhall,",
            "line 4: action 'go' in state 'yard' goes on from a goal",
        ),
    ],
)
def test_paths_that_cannot_be_used(tmp_path: Path, rows: str, message: str) -> None:
    file = written(tmp_path, f"state,action\n{rows}\n")
    paths, (problem,) = read_table_paths(file, house(tmp_path), *NAMES)
    assert not paths
    assert message in str(problem)
    assert str(problem).startswith(str(file))


def test_one_wrong_trial_leaves_the_others(tmp_path: Path) -> None:
    rows = "trial,state,action\na,hall,go\na,door,push\na,yard,\nb,hall,back\nb,hall,\n"
    paths, problems = read_table_paths(written(tmp_path, rows), house(tmp_path), *NAMES)
    assert [path.name for path in paths] == ["file_a"]
    assert "file.csv, trial b: line 5: action 'back'" in str(problems[0])
    nameless = written(tmp_path, "trial,state,action\n,hall,go\n")
    _, problems = read_table_paths(nameless, house(tmp_path), *NAMES)
    assert "line 2: the trial has no name" in str(problems[0])
    headless = written(tmp_path, "hall,go\ndoor,push\n")
    _, problems = read_table_paths(headless, house(tmp_path), *NAMES)
    assert "line 1 must name the columns state, action; state and action is not" in str(problems[0])


def test_a_horizon_bounds_the_number_of_moves(tmp_path: Path) -> None:
    file = written(tmp_path, "state,action\nhall,go\ndoor,push\nyard,\n")
    table = house(tmp_path)
    assert read_table_paths(file, table, *NAMES, steps=5).paths
    _, problems = read_table_paths(file, table, *NAMES, steps=1)
    assert "line 4: the path has 2 moves, and the horizon is 1" in str(problems[0])
