"""Whether a classifier knows the like of what it sees: distance of its features from those of its training clips.

The features of each class are taken for normal with a mean of their own and one covariance (Lee, Lee, Lee & Shin 2018,
"A simple unified framework for detecting out-of-distribution samples"); the distance is the logarithm of the nearest
class's squared Mahalanobis distance, averaged over the rows of features that a classifier gives. It becomes a share by
comparison with known objects of other families: the conformal p-value (Vovk, Gammerman & Shafer 2005; Bates et al.
2023), which is below a level for that share of known objects, as far as they are like those compared with.

What is fitted lies beside the weights that it belongs to, in `<stem>.familiarity.safetensors`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from aerojax.classify.answer_sets import COVERAGE, AnswerSet, family_of, least_probabilities
from aerojax.classify.load import shipped_name
from aerojax.core.errors import UserError
from aerojax.core.files import sha256_of_file
from aerojax.core.tensors import filled, read_tensors, write_tensors
from aerojax.core.types import CLASSES, pytree_dataclass

SUFFIX = ".familiarity.safetensors"
SHRINKAGE = 0.1
"""Of the mean variance, added to the covariance's diagonal; 0.01 to 0.3 tell validation outliers apart as well."""
_ARRAYS = ("mean", "whitening", "weight", "known", "least", "coverage")
_NO_SETS = {"least": np.zeros(0, np.float32), "coverage": np.zeros(1, np.float32)}
"""Of files of before there were sets of classes."""


@pytree_dataclass
class Familiarity:
    """What is remembered of the training clips and of known objects to compare with.

    mean: of each class's features. whitening: features about them times this have unit covariance.
    weight: of each row of features, sum 1.
    known: distances of validation clips after their first, second, … frame, in ascending order.
    least: probability that a class needs after so many frames to be in the answer's set; empty where there are no sets.
    coverage: of those sets; see `answer_sets`.
    """

    mean: Float[Array, "row class feature"]
    whitening: Float[Array, "row feature feature"]
    weight: Float[Array, "row"]
    known: Float[Array, "length clip"]
    least: Float[Array, "steps"]
    coverage: Float[Array, "1"]

    def distance(self, features: Float[Array, "row feature"]) -> Float[Array, ""]:
        """From each row's nearest class, logarithmic, weighted mean over the rows; see `Embedding`."""
        apart = jnp.einsum("rcf,rfg->rcg", features[:, None] - self.mean, self.whitening)
        nearest = jnp.min(jnp.sum(apart * apart, axis=-1), axis=-1)
        return jnp.sum(self.weight * jnp.log(jnp.maximum(nearest, 1e-12)))

    def share(self, features: Float[Array, "row feature"], frames: Int[Array, ""] | int) -> Float[Array, ""]:
        """The share of known objects that look as strange after so many frames, above 0 and at most 1.

        Args:
            features: after the last frame.
            frames: that counted for them; beyond the longest known clips those count.
        """
        known = self.known[jnp.clip(jnp.asarray(frames) - 1, 0, self.known.shape[0] - 1)]
        farther = jnp.sum(known >= self.distance(features))
        return (1 + farther).astype(self.known.dtype) / (known.shape[0] + 1)

    def answer_set(self, log_probabilities: Float[np.ndarray, "label"], frames: int) -> AnswerSet | None:
        """The classes that an object could be of if it is of one of them; None where there are no sets.

        Args:
            log_probabilities: after the last frame.
            frames: that counted for them; beyond the longest known clips those count.
        """
        if self.least.shape[0] == 0:
            return None
        least = float(self.least[min(max(frames, 1), self.least.shape[0]) - 1])
        order = np.argsort(-log_probabilities, kind="stable")
        held = [CLASSES[i] for n, i in enumerate(order) if n == 0 or np.exp(log_probabilities[i]) >= least]
        return AnswerSet(tuple(held), round(float(self.coverage[0]), 6))


@dataclass(frozen=True, eq=False)
class KnownClips:
    """Validation clips of the classes as a classifier sees them.

    features, log_probabilities: after each frame. present: frames that count, the first ones of a clip; one that ends
    is represented by its last frame among longer ones. label: index into `CLASSES`. identity: names of individuals.
    """

    features: Float[np.ndarray, "clip time row feature"]
    log_probabilities: Float[np.ndarray, "clip time label"]
    present: Bool[np.ndarray, "clip time"]
    label: Int[np.ndarray, "clip"]
    identity: tuple[str, ...]

    def held(self, values: Float[np.ndarray, "clip time *row"]) -> Float[np.ndarray, "clip time *row"]:
        """Values after each frame, those of the last one that counts behind it."""
        last = np.maximum(self.present.sum(axis=1) - 1, 0)
        index = np.minimum(np.arange(values.shape[1]), last[:, None])
        return values[np.arange(len(last))[:, None], index]


def fit_familiarity(
    features: Float[np.ndarray, "clip row feature"],
    label: Int[np.ndarray, "clip"],
    known: KnownClips,
    weight: tuple[float, ...],
) -> Familiarity:
    """Fit class means and their covariance, measure the distances of known objects, and calibrate sets of classes.

    Args:
        features: of whole training clips. label: their classes, all of which occur.
        known: objects of other families.
        weight: `Embedding.feature_weights`.

    Raises:
        UserError: the clips of each class have the same features.
    """
    x = features.astype(np.float64)
    mean = np.stack([x[label == one].mean(axis=0) for one in range(int(label.max()) + 1)], axis=1)
    whitening = np.stack([_whitening(x[:, n] - mean[n, label]) for n in range(x.shape[1])])
    family = [family_of(name) for name in known.identity]
    least = least_probabilities(known.held(known.log_probabilities), known.label, family)
    least = np.nextafter(least.astype(np.float32), np.float32(0.0))  # rounding must not put the clip of it outside
    fixed = mean, whitening, np.array(weight), np.zeros((1, 1)), least, np.array([COVERAGE])
    empty = Familiarity(*map(_single, fixed))
    distance = np.asarray(jax.jit(jax.vmap(jax.vmap(empty.distance)))(_single(known.features)))
    return replace(empty, known=_single(np.sort(known.held(distance).T, axis=1)))


def _whitening(apart: Float[np.ndarray, "clip feature"]) -> Float[np.ndarray, "feature feature"]:
    covariance = apart.T @ apart / len(apart)
    if not np.trace(covariance) > 0:
        problem = "the training clips of each class have the same features"
        raise UserError("invalid", problem, "give several different clips of a class")
    covariance += SHRINKAGE * np.trace(covariance) / len(covariance) * np.eye(len(covariance))
    return np.linalg.cholesky(np.linalg.inv(covariance))


def _single(values: np.ndarray) -> Float[Array, "..."]:
    return jnp.asarray(values, jnp.float32)


def familiarity_path(weights: Path) -> Path:
    """Where the familiarity of weights lies."""
    return weights.with_name(weights.name.removesuffix(".safetensors") + SUFFIX)


def save_familiarity(weights: Path, familiarity: Familiarity, record: Mapping[str, Any]) -> Path:
    """Write it beside the weights that its features came from; return where.

    Args:
        weights: the classifier's file, which it is bound to by its hash.
        familiarity: of that classifier.
        record: JSON-ready, of what made it and how good it is.
    """
    header = {"weights": sha256_of_file(weights), "record": json.dumps(dict(record))}
    path = familiarity_path(weights)
    write_tensors(path, familiarity, header)
    return path


def load_familiarity(weights: Path | None = None) -> Familiarity | None:
    """What lies beside the weights of a classifier; None where nothing does, so that nothing is called unknown.

    Args:
        weights: as for `load_classifier`.

    Raises:
        UserError: it belongs to other weights, or is broken.
    """
    if (name := shipped_name(weights)) is not None:
        with as_file(files("aerojax.classify") / "pretrained") as folder:
            return load_familiarity(folder / name)
    assert weights is not None  # no weights are those that are shipped
    path = familiarity_path(weights)
    if not path.is_file():
        return None
    tensors, header = read_tensors(path)
    if header.get("weights") != sha256_of_file(weights):
        problem = f"{path} was fitted to other weights than {weights}"
        raise UserError("mismatch", problem, "fit it again with experiments.fit_familiarity, or delete it")
    tensors = {**_NO_SETS, **tensors}
    shapes: dict[str, tuple[int, ...]] = {name: tensors[name].shape for name in _ARRAYS if name in tensors}
    rows, _, width = shapes.get("mean", ()) if len(shapes.get("mean", ())) == 3 else (0, 0, 0)
    fits = shapes.get("whitening") == (rows, width, width) and shapes.get("weight") == (rows,)
    sets = len(shapes["least"]) == 1 and shapes["coverage"] == (1,)
    if not rows or not fits or not sets or len(shapes.get("known", ())) != 2:
        raise UserError("invalid", f"{path} does not hold means, whitening and known distances", "fit it again")
    expected = jax.eval_shape(lambda: Familiarity(*(jnp.zeros(shapes[name]) for name in _ARRAYS)))
    return filled(expected, tensors, path, whose="a familiarity")
