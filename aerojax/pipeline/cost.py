"""What classifying costs on this machine: one frame of a stream, a clip, and the pipeline's stage around it."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from aerojax.classify.base import Trainable, with_card
from aerojax.core.tensors import parameter_count
from aerojax.core.types import Crops, Evidence, Gaussians
from aerojax.pipeline.config import PipelineConfig
from aerojax.reconstruct.crop import small_crops


def random_tokens(frames: int, tokens: int, *, seed: int) -> Float[Array, "time token 14"]:
    """Gaussians about the unit ball; what they show does not change the cost."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(frames, tokens, 14)).astype(np.float32)
    columns[..., 7:11] = rng.uniform(0.01, 0.1, columns[..., 7:11].shape)
    return jnp.asarray(columns)


def milliseconds(call: Callable[[], Any], *, repeats: int) -> list[float]:
    """Wall-clock times of as many calls, after one that compiles; each is waited for."""
    jax.block_until_ready(call())
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(call())
        spent.append(1e3 * (time.perf_counter() - start))
    return spent


def program_cost(call: Callable[..., Array], arguments: tuple[Any, ...], *, repeats: int) -> dict[str, Any]:
    """Seconds of compilation, milliseconds of a call, and megabytes.

    `working_mb` is what the compiled program wants besides its inputs and outputs; `process_peak_mb` is the largest
    resident size of this process so far, with all that was measured before.
    """
    start = time.perf_counter()
    program = jax.jit(call).lower(*arguments).compile()
    compiled, memory = time.perf_counter() - start, program.memory_analysis()
    spent = milliseconds(lambda: program(*arguments), repeats=repeats)
    return {
        "compile_s": compiled,
        "latency_ms": float(np.median(spent)),
        "latency_ms_quartiles": np.quantile(spent, [0.25, 0.75]).tolist(),
        "working_mb": None if memory is None else memory.temp_size_in_bytes / 2**20,
        "arguments_mb": None if memory is None else memory.argument_size_in_bytes / 2**20,
        "process_peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10,
    }


@jax.jit
def _step(classifier: Trainable, seen: Evidence, state: Any) -> tuple[Float[Array, "label"], Any]:
    return classifier.step(seen, jnp.ones((), bool), state)


@jax.jit
def _clip(classifier: Trainable, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
    return classifier.clip(seen, valid)


def member_cost(
    classifier: Trainable, config: PipelineConfig, *, views: int, repeats: int, seed: int = 0
) -> dict[str, Any]:
    """Parameters of any classifier, and milliseconds a frame.

    Args:
        classifier: causal or not.
        config: says how many Gaussians and which crops the classify stage is given.
        views: cameras.
        repeats: timed calls.
        seed: of the Gaussians and crops.

    Returns:
        Medians: `step_ms` of one frame with one subset of tokens, `clip_ms` a frame of a whole clip with the same,
        `stage_ms` of the classify stage as the pipeline runs it: crops made small, every subset of its Gaussians read,
        the answer on the host. Steps are None for classifiers that are not causal.
    """
    rng, frames = np.random.default_rng(seed), classifier.card.frames
    size = config.crop_size
    rgb = rng.uniform(size=(views, size, size, 3)).astype(np.float32)
    mask = (rng.uniform(size=(views, size, size)) > 0.5).astype(np.float32)
    once = with_card(classifier, token_ensembles=1)
    rgba = jnp.asarray(small_crops(rgb, mask, size=config.view_size))
    few = Gaussians.from_columns(random_tokens(frames, classifier.card.tokens, seed=seed))
    many = Gaussians.from_columns(random_tokens(1, config.decimation.keep, seed=seed)[0])
    whole = Evidence(few, Crops(jnp.tile(rgba, (frames, 1, 1, 1, 1)), jnp.ones((frames, views), bool)))
    first = jax.tree.map(lambda leaf: leaf[0], whole)

    found: dict[str, Any] = {"parameters": parameter_count(classifier.network), "tokens": classifier.card.tokens}
    found |= {"token_ensembles": classifier.card.token_ensembles, "frames": frames, "step_ms": None, "stage_ms": None}
    present = jnp.ones(frames, bool)
    found["clip_ms"] = float(np.median(milliseconds(lambda: _clip(once, whole, present), repeats=repeats))) / frames
    if classifier.causal:
        fresh, state = once.initial(), classifier.initial()

        def stage() -> np.ndarray:
            made = Crops(jnp.asarray(small_crops(rgb, mask, size=config.view_size)), jnp.ones(views, bool))
            return np.asarray(_step(classifier, Evidence(many, made), state)[0])

        found["step_ms"] = float(np.median(milliseconds(lambda: _step(once, first, fresh), repeats=repeats)))
        found["stage_ms"] = float(np.median(milliseconds(stage, repeats=repeats)))
    return found
