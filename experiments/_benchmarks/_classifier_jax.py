"""Our classifier, its forward pass and its training step, as the comparison with PyTorch calls them."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax

from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.training.loop import smoothed_cross_entropy
from aerojax.training.optimisers import OptimiserConfig, optimiser_of


@jax.jit
def _forward(model: MambaSplat, columns: jax.Array, mask: jax.Array) -> jax.Array:
    return jax.vmap(model)(columns, mask)


class Engine:
    """A model, an optimiser and inputs of one size; `forward` and `step` do one call each."""

    def __init__(self, *, variant: str):
        config = MambaSplatConfig() if variant == "exact" else published_config()
        self.model = MambaSplat(config, key=jax.random.key(0))
        self.parameters = sum(leaf.size for leaf in jax.tree.leaves(self.model))
        self.version = jax.__version__
        optimiser = optimiser_of(OptimiserConfig(), 1000)
        self.moments = optimiser.init(self.model)  # pyrefly: ignore

        def update(model: Any, moments: Any, columns: Any, mask: Any, label: Any, key: Any) -> tuple[Any, Any]:
            def loss(model: Any) -> jax.Array:
                keys = jax.random.split(key, len(label))
                logits = jax.vmap(lambda c, m, k: model(c, m, key=k))(columns, mask, keys)
                return jnp.mean(smoothed_cross_entropy(logits, label, 0.1))

            change, moments = optimiser.update(jax.grad(loss)(model), moments, model)
            return optax.apply_updates(model, change), moments

        self._update = jax.jit(update)
        self.key = jax.random.key(1)

    def load(self, columns: np.ndarray) -> None:
        """Take clips (clip, frame, token, 14), all tokens valid, of classes 0, 1, 2, …"""
        self.columns, self.mask = jnp.asarray(columns), jnp.ones(columns.shape[:3], bool)
        self.label = jnp.arange(len(columns)) % self.model.config.classes
        self._programs: dict[str, Any] = {}

    def program(self, act: str) -> Any:
        """The compiled call for the loaded size."""
        if act not in self._programs:
            function = _forward if act == "forward" else self._update
            self._programs[act] = function.lower(*self._arguments(act)).compile()
        return self._programs[act]

    def forward(self) -> None:
        """Logits, without dropout."""
        jax.block_until_ready(self.program("forward")(*self._arguments("forward")))

    def step(self) -> None:
        """Loss, gradient, clipping, AdamW."""
        self.model, self.moments = jax.block_until_ready(self.program("step")(*self._arguments("step")))

    def _arguments(self, act: str) -> tuple[Any, ...]:
        if act == "forward":
            return self.model, self.columns, self.mask
        return self.model, self.moments, self.columns, self.mask, self.label, self.key
