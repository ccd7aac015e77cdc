"""The commands behind the ledger: that they compose in every preset, and when one is done."""

from __future__ import annotations

import json

import pytest
from support.act_configs import NAMES, values_of

from aerojax.core.errors import UserError
from aerojax.evaluate.ledger import read_claims
from aerojax.evaluate.ledger_runs import Step, command_of, finish, is_done, read_steps

STEP = Step(name="one", command="act 'a=[x,{preset}]' b=1", leaves="results.json")


def test_a_command_has_its_preset_and_its_folder(tmp_path):
    words = STEP.arguments("small", tmp_path)
    assert words == ["experiments.act", "preset=small", "a=[x,small]", "b=1", f"hydra.run.dir={tmp_path}/one"]
    swept = Step(name="two", command="act", sweep=True).arguments("smoke", tmp_path)
    assert swept[-1] == f"hydra.sweep.dir={tmp_path}/two"


def test_a_step_is_done_with_its_own_command(tmp_path):
    folder, results = tmp_path / "runs", tmp_path / "results"
    with pytest.raises(UserError, match="ended without it"):
        finish(STEP, "small", folder, results)
    (folder / "one").mkdir(parents=True)
    (folder / "one/results.json").write_text('{"a": 1}')
    assert not is_done(STEP, "small", folder)
    results.mkdir(exist_ok=True)
    finish(STEP, "small", folder, results)
    assert json.loads((results / "one.json").read_text()) == {"a": 1}
    assert is_done(STEP, "small", folder) and not is_done(STEP, "full", folder)
    assert not is_done(Step(name="one", command="act b=2", leaves="results.json"), "small", folder)


@pytest.mark.parametrize("preset", ["smoke", "small", "full"])
def test_every_command_composes(preset, tmp_path):
    for step in read_steps(preset):
        module, *overrides = step.arguments(preset, tmp_path)
        act = module.removeprefix("experiments.")
        assert act in NAMES
        one_run = [one.partition(",")[0] if step.sweep else one for one in overrides]
        values_of(act, *(one for one in one_run if not one.startswith("hydra.")))


def test_every_file_that_claims_need_is_made_by_a_step():
    """Files that are there may have been made by other commands; they say by which."""
    for name in {one.result for one in read_claims() if one.result}:
        assert (command_of(name) or "").startswith("python -m experiments."), name
    assert command_of("clips_train") is None and command_of("measure_accuracy_small") == (
        "python -m experiments.measure_accuracy 'datasets=[data/aerosplat4d_small]'"
    )
