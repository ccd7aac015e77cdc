"""One of several processes that train a small model together.

python tests/support/training_process.py FOLDER DIE COORDINATOR PROCESS COUNT

The process kills itself before step DIE, unless that is 0. It prints the figures of every step that it is told of.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.training.distribution import DistributionConfig, join_processes, own_share
from aerojax.training.loop import Fit, TrainingConfig, fit
from aerojax.training.optimisers import OptimiserConfig
from aerojax.training.variation import epoch_order

CONFIG = TrainingConfig(
    epochs=3, batch=8, micro_batches=2, checkpoint_steps=3, optimiser=OptimiserConfig(learning_rate=0.05)
)
INPUTS = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32)
TARGETS = INPUTS @ np.array([1.0, -2.0, 0.5], np.float32)


def loss(model, batch, keys):
    x, y = batch
    noise = 0.1 * jax.vmap(jax.random.normal)(keys)
    return jnp.mean((jnp.tanh(x @ model["in"]) @ model["out"] + noise - y) ** 2)


def task(die: int) -> Fit:
    def batches(epoch):
        for place, index in enumerate(epoch_order(len(INPUTS), CONFIG.batch, seed=1, epoch=epoch)):
            if 5 * epoch + place + 1 == die:
                os.kill(os.getpid(), signal.SIGKILL)
            share = own_share(index)
            yield INPUTS[share], TARGETS[share]

    def validate(model):
        error = np.mean((np.tanh(INPUTS @ np.asarray(model["in"])) @ np.asarray(model["out"]) - TARGETS) ** 2)
        return {"error": float(error), "score": -float(error)}

    def watch(step, figures):
        print(json.dumps({"step": step, **figures}), flush=True)

    return Fit(loss, batches, 5, validate, lambda row: None, watch)


if __name__ == "__main__":
    folder, die, coordinator, process, count = sys.argv[1:]
    join_processes(DistributionConfig(coordinator, int(process), int(count)))
    rng = np.random.default_rng(2)
    start = {name: rng.normal(size=shape).astype(np.float32) for name, shape in (("in", (3, 4)), ("out", (4,)))}
    best = fit(start, task(int(die)), CONFIG, seed=3, directory=Path(folder))
    print(json.dumps({name: np.asarray(leaf).tolist() for name, leaf in best.items()}), flush=True)
