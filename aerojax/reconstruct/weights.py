"""Parameters of trained reconstructors on disk: safetensors, in whose header is the configuration they belong to."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax

from aerojax.core.claims import differing
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.tensors import filled, read_tensors, write_tensors

if TYPE_CHECKING:  # the door opens this file
    from aerojax.reconstruct.base import TrainableConfig, TrainableReconstructor

CONFIG_KEY, RECORD_KEY = "config", "record"


def save_reconstructor(
    path: Path, reconstructor: TrainableReconstructor, config: TrainableConfig, record: Mapping[str, Any]
) -> None:
    """Write a reconstructor's parameters; the file is complete or absent.

    Args:
        path: the file to write, usually `*.safetensors`.
        reconstructor: of `config`.
        config: kept in the header, without the place of other weights.
        record: how it was trained and what it reached, JSON-ready.
    """
    header = {CONFIG_KEY: json.dumps(_kept(config)), RECORD_KEY: json.dumps(dict(record))}
    write_tensors(path, reconstructor.network, header)


def load_parameters(config: TrainableConfig) -> TrainableReconstructor:
    """The member with the parameters that its configuration names; read once a process as long as the file stays.

    Raises:
        UserError: the file is absent or broken, belongs to a configuration that differs, or holds other tensors.
    """
    if config.weights:
        return _loaded(config, Path(config.weights), _stamp(Path(config.weights)))
    with as_file(files("aerojax.reconstruct") / "pretrained" / f"{_kept(config)['name']}.safetensors") as shipped:
        return _loaded(config, shipped, _stamp(shipped))


def weights_header(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The configuration, as a mapping with the member's name, and the record that a file holds.

    Raises:
        UserError: it is no file of `save_reconstructor`.
    """
    return _header(read_tensors(path)[1], path)


def _header(header: Mapping[str, str], path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    try:
        config, record = json.loads(header[CONFIG_KEY]), json.loads(header[RECORD_KEY])
    except (KeyError, ValueError):
        config = record = None
    if not isinstance(config, dict) or not isinstance(record, dict) or "name" not in config:
        raise UserError(
            "missing", f"{path} does not say which reconstructor it holds", "give weights of train_reconstructor"
        )
    return config, record


def _stamp(path: Path) -> int:
    return path.stat().st_mtime_ns if path.is_file() else 0


@lru_cache(maxsize=8)
def _loaded(config: TrainableConfig, path: Path, stamp: int) -> TrainableReconstructor:
    """The member; `stamp` tells versions of one file apart."""
    tensors, header = read_tensors(path)
    trained, _ = _header(header, path)
    if changed := differing(trained, _kept(config), ignoring=config.adjustable):
        remedy = f"set {', '.join(f'{key}={trained.get(key)}' for key in changed)}, or train anew"
        raise UserError("mismatch", f"{path} was trained with another {', '.join(changed)}", remedy)
    shapes = jax.eval_shape(lambda key: config.untrained(key=key), jax.random.key(0))
    network = filled(shapes.network, tensors, path, whose="its configuration")
    return jax.tree.unflatten(jax.tree.structure(shapes), jax.tree.leaves(network))


def _kept(config: TrainableConfig) -> dict[str, Any]:
    return {key: value for key, value in to_mapping(config).items() if key != "weights"}
