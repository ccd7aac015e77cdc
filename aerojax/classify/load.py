"""Trained classifiers on disk: safetensors with the card in the header, read strictly, whatever member they are."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from aerojax.classify.base import Trainable, parameter_names
from aerojax.classify.card import Card, nested_settings
from aerojax.classify.members import MEMBERS
from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes

CARD_KEY = "card"
SHIPPED = {"views": "views_small.safetensors", "mambasplat": "mambasplat_small.safetensors"}
"""Weights in `aerojax/classify/pretrained` by name; the first ones are used where none are named."""


def save_classifier(path: Path, classifier: Trainable) -> None:
    """Write a classifier's parameters and card; the file is complete or absent, never half written.

    Args:
        path: the file to write, usually `*.safetensors`.
        classifier: any member.
    """
    tensors = {name: np.ascontiguousarray(leaf) for name, leaf in parameter_names(classifier.network)}
    write_bytes(path, save(tensors, metadata={CARD_KEY: classifier.card.to_json()}))


def load_classifier(path: Path | None = None) -> Trainable:
    """Read a classifier that `save_classifier` wrote.

    Args:
        path: the weights; a name of `SHIPPED` for those that come with the package, None for the first of them.

    Raises:
        UserError: the file is absent or broken; its header has no card, or one that lacks a field or contradicts
            itself; or names every tensor that is missing, unknown, of another shape or type, or not finite.
    """
    name = next(iter(SHIPPED)) if path is None else str(path)
    if path is None or (name in SHIPPED and not path.exists()):
        with as_file(files("aerojax.classify") / "pretrained" / SHIPPED[name]) as shipped:
            return load_classifier(shipped)
    tensors, header = _read(path)
    if CARD_KEY not in header:
        raise UserError(
            "missing", f"{path} has no entry {CARD_KEY!r} in its header", "give weights of experiments.train_classifier"
        )
    card = Card.from_json(header[CARD_KEY], source=str(path))
    classifier = _shapes(card, path)
    leaves, structure = jax.tree.flatten(classifier)
    expected = dict(zip((name for name, _ in parameter_names(classifier.network)), leaves, strict=True))
    if problems := _problems(tensors, expected):
        raise UserError("invalid", "\n  ".join([f"{path} does not fit its own card:", *problems]), "fetch it again")
    return jax.tree.unflatten(structure, [jnp.asarray(tensors[name]) for name in expected])


def _shapes(card: Card, path: Path) -> Trainable:
    """The classifier that a card describes, with shapes for parameters; nothing of their size is made."""
    try:
        return jax.eval_shape(lambda key: _build(card, path, key), jax.random.key(0))
    except UserError:
        raise
    except Exception as error:  # sizes that no array has fail wherever they are used first
        raise UserError(
            "invalid", f"{path}: no network can be made as its card says ({type(error).__name__})", "fetch it again"
        ) from error


def _build(card: Card, path: Path, key: jax.Array) -> Trainable:
    if card.member not in MEMBERS:
        raise UserError(
            "invalid",
            f"{path} holds a classifier of the kind {card.member!r}, known are {', '.join(sorted(MEMBERS))}",
            "update aerojax or give other weights",
        )
    values = {"name": card.member, **nested_settings(card.config)}
    return to_dataclass(values, MEMBERS[card.member], source=f"the card of {path}").build(card, key=key)


def _problems(tensors: dict[str, np.ndarray], expected: dict[str, jax.ShapeDtypeStruct]) -> list[str]:
    """Everything for which the tensors are not those of the model, in words."""
    problems = [f"missing tensor {name}" for name in expected if name not in tensors]
    problems += [f"unknown tensor {name}" for name in tensors if name not in expected]
    for name, wanted in expected.items():
        found = tensors.get(name)
        if found is None:
            continue
        if found.shape != wanted.shape or found.dtype != wanted.dtype:
            problems.append(f"tensor {name} is {found.dtype} {found.shape}, expected {wanted.dtype} {wanted.shape}")
        elif not np.isfinite(found).all():
            problems.append(f"tensor {name} holds numbers that are not finite")
    return problems


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    if not path.is_file():
        raise UserError("missing", f"weights file {path} does not exist", "train a model or correct the path")
    try:
        with safe_open(path, framework="numpy") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except (SafetensorError, TypeError) as error:
        raise UserError(
            "unreadable", f"{path} is not a complete safetensors file of numbers ({error})", "fetch or write it again"
        ) from None
