"""Published weights as members: names in both directions, both kinds of files, and what does not fit by name."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from safetensors.numpy import save_file
from support.command_line import run_command
from support.torch_files import write_archive

from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_names, read_tensors
from aerojax.reconstruct.depthsplat.config import DepthSplatConfig
from aerojax.reconstruct.depthsplat.reconstructor import untrained_depthsplat
from aerojax.reconstruct.depthsplat.released import import_depthsplat
from aerojax.reconstruct.depthsplat.tensor_names import MONOCULAR, published_tensors
from experiments import import_reconstructor as act

SIZES = {
    "candidates": 8,
    "stem_width": 8,
    "half_width": 8,
    "width": 16,
    "blocks": 2,
    "vit_width": 24,
    "vit_blocks": 4,
    "vit_heads": 3,
    "vit_grid": 4,
    "unet_width": 16,
    "unet_head": 16,
    "depth_width": 8,
    "feature_width": 8,
    "head_width": 8,
    "sh_degree": 1,
}
"""The published network in small: names depend on its form, not on its widths."""
CONFIG = DepthSplatConfig(**SIZES)
KEY = jax.random.key(0)


@pytest.fixture(scope="module")
def published():
    """Numbers of their own under the published names."""
    shapes = jax.eval_shape(lambda key: untrained_depthsplat(CONFIG, key=key), KEY)
    rng = np.random.default_rng(0)
    named = published_tensors(shapes.network)
    return {name: rng.standard_normal(leaf.shape).astype(np.float32) for name, leaf in named.items()}


def check(network, published):
    found = published_tensors(network)
    assert set(found) == set(published)
    for name, value in published.items():
        np.testing.assert_array_equal(found[name], value, err_msg=name)


def test_the_encoder_from_a_training_run(published, tmp_path):
    """torch.save of a run: a prefix, tensors of other parts, and the sizes that the shapes say."""
    stored = {f"encoder.{name}": value for name, value in published.items()}
    stored |= {"encoder.depth_predictor.pretrained.mask_token": np.zeros((1, 24), np.float32)}
    stored |= {"losses.0.scale": np.ones(1, np.float32)}
    write_archive(tmp_path / "a.pth", {"state_dict": stored})
    given = dataclasses.replace(CONFIG, candidates=32, sh_degree=2)
    imported = import_depthsplat(tmp_path / "a.pth", given, key=KEY)
    assert (imported.config, imported.kind) == (CONFIG, "encoder")
    assert imported.unused == ("encoder.depth_predictor.pretrained.mask_token", "losses.0.scale")
    check(imported.reconstructor.network, published)


def test_the_act(published, tmp_path, monkeypatch):
    """Depth-Anything's branch in safetensors; its own decoder has no place here. What comes out builds the member."""
    alone = {"pretrained." + n.removeprefix(MONOCULAR): v for n, v in published.items() if n.startswith(MONOCULAR)}
    save_file(alone | {"depth_head.scratch.weight": np.ones(3, np.float32)}, tmp_path / "vits.safetensors")
    sizes = [f"reconstruct.{name}={value}" for name, value in SIZES.items()]
    arguments = (f"checkpoint={tmp_path}/vits.safetensors", f"out={tmp_path}/out.safetensors", *sizes)
    run_command(act, monkeypatch, *arguments, f"hydra.run.dir={tmp_path}/run")
    member = dataclasses.replace(CONFIG, weights=str(tmp_path / "out.safetensors")).build()
    found = published_tensors(member.network)
    for name in published:
        assert np.array_equal(found[name], published[name]) == name.startswith(MONOCULAR) or not published[name].any()
    tensors, header = read_tensors(tmp_path / "out.safetensors")
    assert set(tensors) == {name for name, _ in parameter_names(member.network)}
    assert '"kind": "monocular"' in header["record"]


def test_what_does_not_fit_is_named(published, tmp_path):
    wrong = dict(published)
    del wrong["gaussian_head.0.bias"]
    wrong["depth_predictor.backbone.conv1.weight"] = np.zeros((8, 4, 7, 7), np.float32)
    wrong["depth_predictor.backbone.conv2.bias"] = np.full(16, np.nan, np.float32)
    wrong["depth_predictor.mv_pyramid.0.weight"] = np.zeros(2, np.float32)
    save_file(wrong, tmp_path / "wrong.safetensors")
    with pytest.raises(UserError) as caught:
        import_depthsplat(tmp_path / "wrong.safetensors", CONFIG, key=KEY)
    assert caught.value.code == "invalid"
    for named in (
        "missing tensor gaussian_head.0.bias",
        "conv1.weight has shape (8, 4, 7, 7), expected (8, 3, 7, 7)",
        "conv2.bias holds numbers that are not finite",
        "unknown tensor depth_predictor.mv_pyramid.0.weight",
    ):
        assert named in caught.value.problem


def test_other_files_are_refused(tmp_path):
    write_archive(tmp_path / "list.pth", {"model": {"a": np.zeros(2, np.float32)}})
    for name, code in (("list.pth", "unreadable"), ("absent.pth", "missing"), ("absent.safetensors", "missing")):
        with pytest.raises(UserError) as caught:
            import_depthsplat(tmp_path / name, CONFIG, key=KEY)
        assert caught.value.code == code
