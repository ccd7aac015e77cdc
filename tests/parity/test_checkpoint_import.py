"""Released checkpoints as models: the stored logits come out, and whatever does not fit is named."""

from __future__ import annotations

import json

import jax
import numpy as np
import pytest
from support.command_line import run_command
from support.released_weights import recipe_tensors
from support.torch_files import write_archive, write_stream

from aerojax.classify.load import load_classifier
from aerojax.classify.mambasplat.config import published_config
from aerojax.classify.mambasplat.mamba import sinusoids
from aerojax.classify.released.checkpoint import import_checkpoint, infer_config
from aerojax.classify.released.tensor_names import POSITIONS
from aerojax.core.errors import UserError
from experiments import import_checkpoint as act


@pytest.fixture
def state_dict(shared):
    """Everything that a checkpoint of mode X holds, the table of positions too."""

    def make(spec="X"):
        table = np.array(sinusoids(512, 256), np.float32)[None]
        return recipe_tensors(shared, spec, np.float32) | {POSITIONS: table}

    return make


@jax.jit
def _forward(model, columns, mask):
    return jax.vmap(lambda c, m: model(c, m))(columns, mask)


@pytest.mark.parametrize("write", [write_archive, write_stream], ids=["archive", "stream"])
def test_the_act_makes_weights_that_give_the_stored_logits(shared, state_dict, tmp_path, monkeypatch, write):
    golden = np.load(shared / "golden/classifier/X.npz")
    write(tmp_path / "best_model.pt", {"_orig_mod." + name: value for name, value in state_dict().items()})
    out = tmp_path / "made/x.safetensors"
    arguments = (f"checkpoint={tmp_path / 'best_model.pt'}", f"out={out}", f"hydra.run.dir={tmp_path}/run")
    run_command(act, monkeypatch, *arguments)
    classifier = load_classifier(out)
    np.testing.assert_allclose(
        _forward(classifier.network, golden["x"], golden["mask"]), golden["f64/logits"], atol=2e-4, rtol=0
    )
    card = classifier.card
    assert (card.tokens, card.frames, card.rotation_invariant) == (512, 16, False)
    assert json.loads(card.record)["imported"]["file"] == "best_model.pt"
    metrics = json.loads((tmp_path / "run/metrics.json").read_text())
    assert len([name for name in metrics["unused"] if name.startswith("bridge.")]) == 11
    assert metrics["config"]["mode"] == "X" and POSITIONS in metrics["unused"]


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("X", published_config("X")),
        ("C", published_config("C")),
        ("C_S_R", published_config("C_S_R")),
        ("C_O", published_config("C_O")),
        ("C_eps0", published_config("C", bias_epsilon=0.0)),
    ],
)
def test_shapes_tell_the_configuration(state_dict, spec, expected):
    assert infer_config(state_dict(spec)) == expected


def test_half_precision_and_strides_load_too(state_dict, tmp_path):
    tensors = state_dict()
    name = "temporal_encoder.mamba.layers.1.mixer.out_proj.weight"
    write_archive(tmp_path / "a.pt", {k: v.astype(np.float16) for k, v in tensors.items()})
    model = import_checkpoint(tmp_path / "a.pt").model
    stored = np.asarray(model.temporal.layers.mixer.out_proj.weight[...])
    np.testing.assert_array_equal(stored[1], tensors[name].astype(np.float16))


def test_everything_that_does_not_fit_is_named_at_once(state_dict, tmp_path):
    tensors = state_dict() | {"surplus": np.zeros(3, np.float32)}
    tensors["classifier.classifier.0.bias"] = np.zeros(5, np.float32)
    tensors["spatial_encoder.encoder.norm.ln.beta"] = np.ones(14, np.float32)
    tensors[POSITIONS] = tensors[POSITIONS][:, ::-1]
    del tensors["temporal_encoder.mamba.layers.2.mixer.D"]
    write_archive(tmp_path / "a.pt", tensors)
    with pytest.raises(UserError) as error:
        import_checkpoint(tmp_path / "a.pt")
    for part in (
        *("a.pt: ", "unknown tensor surplus", "0.bias has shape (5,), expected (128,)"),
        *("missing tensor temporal_encoder.mamba.layers.2.mixer.D", f"tensor {POSITIONS} is not the usual table"),
        "norm.ln.beta is not zero",
    ):
        assert part in str(error.value)


def test_tensors_that_tell_the_sizes_are_all_asked_for(state_dict, tmp_path):
    tensors = state_dict()
    del tensors[POSITIONS], tensors["classifier.classifier.3.weight"]
    tensors["temporal_encoder.mamba.layers.0.mixer.A_log"] = np.zeros(4, np.float32)
    write_archive(tmp_path / "a.pt", tensors)
    with pytest.raises(UserError) as error:
        import_checkpoint(tmp_path / "a.pt")
    for part in (
        f"missing tensor {POSITIONS}",
        "missing tensor classifier.classifier.3.weight",
        "A_log has shape (4,)",
    ):
        assert part in str(error.value)


def test_sizes_of_no_mode_doubles_and_infinities_are_refused(state_dict, tmp_path):
    tensors = state_dict()
    with pytest.raises(UserError, match="no model of the released code with 5 heads"):
        infer_config(tensors, heads=5)
    bridge = "temporal_encoder.bridge.proj.0.weight"
    with pytest.raises(UserError, match="belong to no model"):
        infer_config(tensors | {bridge: np.zeros((256, 99), np.float32)})
    name = "classifier.classifier.0.bias"
    broken = tensors | {"_orig_mod." + name: tensors[name], "pool": np.array([np.inf], np.float32)}
    write_archive(tmp_path / "a.pt", broken)
    with pytest.raises(UserError, match=r"(?s)0\.bias is there twice.*pool holds numbers"):
        import_checkpoint(tmp_path / "a.pt")


def test_a_checkpoint_of_torch_gives_the_stored_logits(shared, state_dict, tmp_path):
    torch = pytest.importorskip("torch")
    golden = np.load(shared / "golden/classifier/C_O.npz")
    torch.save({name: torch.tensor(value) for name, value in state_dict("C_O").items()}, tmp_path / "a.pt")
    logits = _forward(import_checkpoint(tmp_path / "a.pt").model, golden["x"], golden["mask"])
    np.testing.assert_allclose(logits, golden["f64/logits"], atol=2e-4, rtol=0)
