"""Tensors of the published baselines by the names of our parameters."""

from __future__ import annotations

import re

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.tensors import parameter_names

VECTOR_LAYERS = {
    "map_to_feat.weight": "feature.weight",
    "map_to_dir.weight": "direction.weight",
    "batchnorm.bn.weight": "norm.norm.weight",
    "batchnorm.bn.bias": "norm.norm.bias",
    "batchnorm.bn.running_mean": "norm.norm.running_mean",
    "batchnorm.bn.running_var": "norm.norm.running_variance",
}
STD_FEATURE = {"vn1": "first", "vn2": "second"}
POINTNET = {
    "feat.conv_pos": "position",
    "feat.conv1": "first",
    "feat.conv2": "second",
    **{f"feat.fstn.conv{i}": f"transform.{name}" for i, name in enumerate(("first", "second", "third"), 1)},
    "feat.fstn.fc1": "transform.fourth",
    "feat.fstn.fc2": "transform.fifth",
    **{f"feat.std_feature.{theirs}": f"invariants.{ours}" for theirs, ours in STD_FEATURE.items()},
}
DGCNN = {
    **{f"conv{i}": name for i, name in enumerate(("first", "second", "third", "fourth", "joint"), 1)},
    **{f"std_feature.{theirs}": f"invariants.{ours}" for theirs, ours in STD_FEATURE.items()},
}
MATRICES = {
    "feat.conv3.map_to_feat.weight": "third.weight",
    "feat.std_feature.vn_lin.weight": "invariants.frame.weight",
    "std_feature.vn_lin.weight": "invariants.frame.weight",
    "feat.fstn.fc3.map_to_feat.weight": "transform.out.weight",
}
HEAD = {"1": "head.first", "2": "head.second", "3": "head.out"}
TRANSFORMER = {
    "tube_embedding.conv_d.0.weight": "tube.weight",
    "pos_embedding.": "position.",
    "mlp_head.0.": "head.norm.",
    "mlp_head.1.": "head.hidden.",
    "mlp_head.3.": "head.out.",
}
TRANSFORMER_LAYER = {
    "0.fn.norm.": "attention_norm.",
    "0.fn.fn.to_qkv.": "attention.read.",
    "0.fn.fn.to_out.0.": "attention.out.",
    "1.fn.norm.": "norm.",
    "1.fn.fn.net.0.": "hidden.",
    "1.fn.fn.net.3.": "out.",
}


def vector_name(name: str, layers: dict[str, str]) -> str:
    """Our name of a tensor of VN-PointNet or VN-DGCNN."""
    if name in MATRICES:
        return MATRICES[name]
    for theirs, ours in layers.items():
        if name.startswith(f"{theirs}.") and name[len(theirs) + 1 :] in VECTOR_LAYERS:
            return f"{ours}.{VECTOR_LAYERS[name[len(theirs) + 1 :]]}"
    last = name.rsplit(".", 1)[1].replace("running_var", "running_variance")
    if match := re.fullmatch(r"(fc|linear)(\d)\.\w+", name):
        return f"{HEAD[match[2]]}.{last}"
    if match := re.fullmatch(r"bn(\d)\.\w+", name):
        return f"{HEAD[match[1]]}_norm.{last}"
    assert name.startswith("feat.bn3.bn."), name
    return f"third_norm.norm.{last}"


def vector_tensors(golden, layers: dict[str, str]) -> dict[str, np.ndarray]:
    """Our tensors of a stored VN-PointNet or VN-DGCNN."""
    stored = {name.removeprefix("param:"): golden[name] for name in golden if name.startswith("param:")}
    return {vector_name(name, layers): value for name, value in stored.items() if "num_batches" not in name}


def transformer_tensors(golden) -> dict[str, np.ndarray]:
    """Our tensors of a stored P4Transformer; layers are stacked."""
    found: dict[str, np.ndarray] = {}
    layers: dict[str, list[np.ndarray]] = {}
    for name in sorted(name for name in golden if name.startswith("param:")):
        value, name = golden[name], name.removeprefix("param:")
        if match := re.fullmatch(r"transformer\.layers\.\d+\.(.*)", name):
            theirs = next(prefix for prefix in TRANSFORMER_LAYER if match[1].startswith(prefix))
            ours = "layers." + match[1].replace(theirs, TRANSFORMER_LAYER[theirs])
            layers.setdefault(ours, []).append(value)
        else:
            theirs = next(prefix for prefix in TRANSFORMER if name.startswith(prefix))
            found[name.replace(theirs, TRANSFORMER[theirs])] = (
                value.reshape(value.shape[:2]) if value.ndim > 2 else value
            )
    return found | {name: np.stack(values) for name, values in layers.items()}


def filled_network(shapes, tensors: dict[str, np.ndarray], kind):
    """A network with these tensors: every one is used, none is missing."""
    expected = parameter_names(shapes)
    assert {name for name, _ in expected} == set(tensors)
    for name, leaf in expected:
        assert leaf.shape == tensors[name].shape, name
    leaves = [jnp.asarray(tensors[name].astype(kind)) for name, _ in expected]
    return jax.tree.unflatten(jax.tree.structure(shapes), leaves)
