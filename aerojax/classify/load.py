"""Trained classifiers on disk: safetensors with the card in the header, read strictly, whatever member they are."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import jax

from aerojax.classify.base import Trainable
from aerojax.classify.card import Card, nested_settings
from aerojax.classify.members import MEMBERS
from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.core.tensors import filled, read_tensors, write_tensors

CARD_KEY = "card"
SHIPPED = {"views": "views_small.safetensors", "mambasplat": "mambasplat_small.safetensors"}
"""Weights in `aerojax/classify/pretrained` by name; the first ones are used where none are named."""


def save_classifier(path: Path, classifier: Trainable) -> None:
    """Write a classifier's parameters and card; the file is complete or absent, never half written.

    Args:
        path: the file to write, usually `*.safetensors`.
        classifier: any member.
    """
    write_tensors(path, classifier.network, {CARD_KEY: classifier.card.to_json()})


def load_classifier(path: Path | None = None) -> Trainable:
    """Read a classifier that `save_classifier` wrote.

    Args:
        path: the weights; a name of `SHIPPED` for those that come with the package, None for the first of them.

    Raises:
        UserError: the file is absent or broken; its header has no card, or one that lacks a field or contradicts
            itself; or names every tensor that is missing, unknown, of another shape or type, or not finite.
    """
    if (name := shipped_name(path)) is not None:
        with as_file(files("aerojax.classify") / "pretrained" / name) as shipped:
            return load_classifier(shipped)
    assert path is not None  # no weights are those that are shipped
    tensors, header = read_tensors(path)
    if CARD_KEY not in header:
        raise UserError(
            "missing", f"{path} has no entry {CARD_KEY!r} in its header", "give weights of experiments.train_classifier"
        )
    card = Card.from_json(header[CARD_KEY], source=str(path))
    classifier = _shapes(card, path)
    network = filled(classifier.network, tensors, path, whose="its own card")
    return jax.tree.unflatten(jax.tree.structure(classifier), jax.tree.leaves(network))


def shipped_name(path: Path | None) -> str | None:
    """The file of the package that weights name; None where they are a file of their own."""
    name = next(iter(SHIPPED)) if path is None else str(path)
    return SHIPPED[name] if path is None or (name in SHIPPED and not path.exists()) else None


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
