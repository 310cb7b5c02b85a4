"""Plain nested values: one spelling for equal ones."""

from dataclasses import dataclass

import numpy as np
import pytest

from experiments.tracking.files import digest
from experiments.tracking.trees import canonical_json, flatten, plain


@dataclass(frozen=True)
class Region:
    lower: tuple[float | None, ...]
    upper: tuple[float | None, ...]


def test_canonical_json_is_one_spelling() -> None:
    assert canonical_json({"b": (1.0, None), "a": Region((0.1,), (None,))}) == (
        b'{"a":{"lower":[0.1],"upper":[null]},"b":[1.0,null]}'
    )
    # A changed hash would make every finished point a stranger.
    assert digest(canonical_json({"dt": 0.25, "shape": [20, 20]})).startswith("c208a128")
    with pytest.raises(ValueError, match="not JSON compliant"):
        canonical_json({"dt": float("nan")})
    with pytest.raises(TypeError, match="ndarray"):
        canonical_json({"dt": np.zeros(2)})


def test_plain_opens_dataclasses_at_any_depth() -> None:
    region = Region((0.1,), (None,))
    spelt = {"lower": [0.1], "upper": [None]}
    assert plain({1: [region], "b": ("c", region)}) == {"1": [spelt], "b": ["c", spelt]}


def test_flat_tree_has_dotted_keys_in_order_and_lists_as_json() -> None:
    tree = {"b": {"x": 1, "y": {"z": None}}, "a": [1.0, {"k": 2}], "c": "d"}
    flat = flatten(tree)
    assert list(flat.items()) == [
        ("b.x", 1),
        ("b.y.z", None),
        ("a", '[1.0, {"k": 2}]'),
        ("c", "d"),
    ]
