"""What models are trained with: AdamW or SGD, warm-up, cosine or steps, clipping, no decay where it makes no sense."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import jax
import jax.numpy as jnp
import optax

from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_names, statistics

STATISTICS_RATE = 0.1
"""Share of the way to a batch's statistics that running ones move at each update (Ioffe & Szegedy 2015; PyTorch's)."""


@dataclass(frozen=True)
class OptimiserConfig:
    """An optimiser and its schedule (thesis Table 5.5; the weight decay is the published code's).

    rule: AdamW, or SGD with momentum, whose weight decay is a part of the gradient.
    learning_rate: peak.
    warmup: share of all steps with a linear rise.
    final: learning rate at the end over the peak.
    milestones: shares of the run at which the rate is lowered in a step; with any of them there is no cosine.
    factor: of the rate at each of them.
    plateaus: over how many equal parts of the run the rate stays what it is at the part's beginning, as the released
        code keeps it through each of its 50 epochs; 0 changes it with every step.
    weight_decay: of either; beta1, beta2: of AdamW; momentum: of SGD.
    clip_norm: global norm at which gradients are cut; 0 leaves them whole.
    slow: parameters with this word in their names are a group of their own; empty for one group.
    slow_rate: learning rate of that group over the others'.
    """

    rule: Literal["adamw", "sgd"] = "adamw"
    learning_rate: float = 1e-3
    warmup: float = 0.06
    final: float = 1e-3
    milestones: tuple[float, ...] = ()
    factor: float = 0.1
    plateaus: int = 0
    weight_decay: float = 0.05
    beta1: float = 0.9
    beta2: float = 0.95
    momentum: float = 0.9
    clip_norm: float = 1.0
    slow: str = ""
    slow_rate: float = 0.1

    def __post_init__(self) -> None:
        """Refuse milestones outside of the run.

        Raises:
            UserError: names them.
        """
        if not all(0 < share < 1 for share in self.milestones):
            problem = f"milestones is {list(self.milestones)}"
            raise UserError("out-of-range", problem, "they are shares of the run, between 0 and 1")


def decays(parameters: Any) -> Any:
    """Which leaves carry weight decay: matrices do; biases, gains, and the state matrices A and D of Mamba do not.

    Stacked layers have one leading axis more than their layers; a leaf's own rank is what counts, so names decide for
    the stacked vectors.
    """

    def one(path: tuple[Any, ...], leaf: jax.Array | jax.ShapeDtypeStruct) -> bool:
        names = [str(getattr(p, "key", getattr(p, "name", getattr(p, "idx", "")))) for p in path]
        stacked = any(name in ("blocks", "layers") for name in names)
        if any(name in ("A_log", "a_log", "D", "d_skip", "skip") for name in names):
            return False
        return leaf.ndim - stacked > 1

    return jax.tree_util.tree_map_with_path(one, parameters)


def learning_rate(config: OptimiserConfig, steps: int) -> optax.Schedule:
    """By step: linear warm-up from a hundredth of the peak, then half a cosine to `final` times it, or milestones."""
    length = config.plateaus or steps
    warmup = max(1, round(config.warmup * length))
    rate = optax.warmup_cosine_decay_schedule(
        init_value=config.learning_rate * 0.01,
        peak_value=config.learning_rate,
        warmup_steps=warmup,
        decay_steps=max(length, warmup + 1),
        end_value=config.learning_rate * config.final,
    )
    if config.milestones:
        rate = _stepped(config, warmup, length)
    # Division first: the product of a step and a number of plateaus may not fit 32 bits.
    width = max(steps // config.plateaus, 1) if config.plateaus else 1

    def by_step(step: Any) -> Any:
        with jax.numpy_dtype_promotion("standard"):  # optax mixes numbers of steps with shares of them
            return rate(jnp.asarray(step) // width)

    return by_step


def _stepped(config: OptimiserConfig, warmup: int, length: int) -> optax.Schedule:
    """Linear warm-up from a hundredth of the peak, times `factor` for every milestone that is passed."""

    def rate(step: Any) -> Any:
        rising = jnp.minimum(0.01 + 0.99 * step / warmup, 1.0)
        passed = sum((step >= round(share * length)) * 1 for share in config.milestones)
        return config.learning_rate * rising * config.factor**passed

    return rate


def without_statistics(gradient: Any) -> Any:
    """A gradient that is zero for running statistics, whose entries say how far they are from the batch's."""
    return jax.tree.map(lambda leaf, own: jnp.zeros_like(leaf) if own else leaf, gradient, statistics(gradient))


def optimiser_of(config: OptimiserConfig, steps: int) -> optax.GradientTransformation:
    """The optimiser for a run of `steps` updates; running statistics follow their batches by `STATISTICS_RATE`."""
    rate, decay = learning_rate(config, steps), config.weight_decay
    parts = [optax.clip_by_global_norm(config.clip_norm)] if config.clip_norm else []
    if config.rule == "adamw":
        parts.append(optax.adamw(rate, b1=config.beta1, b2=config.beta2, weight_decay=decay, mask=decays))
    else:
        parts += [optax.add_decayed_weights(decay, mask=decays), optax.sgd(rate, momentum=config.momentum)]
    if config.slow:
        # The change, decay included, is proportional to the rate.
        parts.append(optax.masked(optax.scale(config.slow_rate), lambda tree: _named(tree, config.slow)))
    chain = optax.chain(*parts)

    def update(updates: Any, state: Any, params: Any = None) -> tuple[Any, Any]:
        with jax.numpy_dtype_promotion("standard"):  # optax raises decays to integer powers
            change, state = chain.update(without_statistics(updates), state, params)

        def follow(leaf: Any, own: bool, gradient: Any) -> Any:
            return -STATISTICS_RATE * gradient if own else leaf

        return jax.tree.map(follow, change, statistics(updates), updates), state

    return optax.GradientTransformation(chain.init, update)


def _named(parameters: Any, word: str) -> Any:
    """Which leaves have a word in their names.

    Raises:
        UserError: none has.
    """
    names = [name for name, _ in parameter_names(parameters)]
    if not any(word in name for name in names):
        raise UserError("mismatch", f"optimiser.slow={word} is in no name of {len(names)} parameters", "correct it")
    return jax.tree.unflatten(jax.tree.structure(parameters), [word in name for name in names])
