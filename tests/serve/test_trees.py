"""States come back with the same bits, types and classes; nothing else is made from a file."""

from __future__ import annotations

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.segment.voxel_vote.member import CameraState
from aerojax.serve.trees import NotStorable, from_tree, to_tree
from aerojax.track.following import FollowingState
from aerojax.track.several import SeveralState
from aerojax.track.sights import Scan


def there_and_back(value):
    return from_tree(*to_tree(value))


def test_everything_comes_back():
    scan = Scan(2, 0.5, np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))
    following = FollowingState(0.5, math.inf, (), frozenset({2, 0}), {2: scan}, 3, 1)
    value = {
        "state": SeveralState((), following),
        "camera": CameraState(None, (np.arange(6, dtype=np.uint8).reshape(1, 2, 3),), 4),
        "jax": (jnp.float32(1.5), jnp.arange(3) == 1, None),
        "scalars": [np.float32(0.1), True, 7, "text", math.nan],
    }
    found = there_and_back(value)
    assert found["state"].following.heard == {0, 2} and found["state"].following.began_s == math.inf
    np.testing.assert_array_equal(found["state"].following.unclaimed[2].pixels, np.zeros((0, 2)))
    assert found["camera"].images[0].dtype == np.uint8 and found["camera"].seen == 4
    one, many, nothing = found["jax"]
    assert isinstance(one, jax.Array) and one.shape == () and float(one) == 1.5 and nothing is None
    assert many.tolist() == [False, True, False]
    kind, yes, number, text, nan = found["scalars"]
    assert kind == np.float32(0.1) and isinstance(kind, np.float32) and (yes, number, text) == (True, 7, "text")
    assert math.isnan(nan)


@dataclass(frozen=True)
class Foreign:
    """Not of the package."""

    value: int = 1


@pytest.mark.parametrize("value", [Foreign(), object(), {1, 2}, np.array(["a"]), lambda: None])
def test_what_cannot_be_stored_is_named(value):
    with pytest.raises(NotStorable, match=r"\w"):
        to_tree({"inside": (value,)})


@pytest.mark.parametrize(
    "name",
    [
        "os:system",
        "subprocess:Popen",
        "aerojax.serve.trees:importlib",
        "aerojax.serve.trees:to_tree",
        "aerojax.serve.service:Service",
        "aerojax.serve.service:Path.home",
        "aerojax.serve.figures:Counter",
    ],
)
def test_only_dataclasses_of_the_package_are_made(name):
    with pytest.raises(ValueError, match="is no"):
        from_tree({"class": name, "fields": {}}, {})
