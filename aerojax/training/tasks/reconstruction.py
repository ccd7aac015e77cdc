"""What it means to train a reconstructor on scenes: which views it gets, its loss, and what validation counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from aerojax.core.errors import UserError
from aerojax.core.images import dilate, peak_signal_to_noise, structural_similarity
from aerojax.core.types import Camera, Gaussians, View, pytree_dataclass
from aerojax.data.views import ViewSet
from aerojax.evaluate.perceptual import Perceptual
from aerojax.evaluate.reconstruction import SURROUND
from aerojax.gaussians.render import Rendering, render
from aerojax.reconstruct.base import TrainableConfig, TrainableReconstructor
from aerojax.training.distribution import own_share
from aerojax.training.loop import Fit, TrainingConfig, fit
from aerojax.training.variation import epoch_order

FAR = 1.04 / 1.37
"""Where the background lies behind the object, in widths of the window at the object: the thesis' far plane of 2.54 m
behind cameras at 1.5 m whose images are 1.37 m wide there (§5.5.1)."""


@dataclass(frozen=True)
class LossConfig:
    """Weights of thesis Eq. 5.2, and what may be added to it; every term compares renderings in the target views.

    colour: mean squared error of the whole image.
    foreground: mean squared error of colour on the object, which is what a small share of the whole image hardly asks
        for: else what is uncertain soon is transparent.
    dssim: 1 - SSIM. perceptual: the distance of the network that the run names.
    mask: mean squared error of alpha.
    depth: mean absolute error on the object, in widths of the window there; what is not covered counts as background.
    background: of the same off the object, over `depth`: Eq. 5.2's background-to-far term.
    decay: weight of a refinement step over that of the next one.
    behind: colour behind the object; "random" is another one for every target.
    """

    colour: float = 1.0
    foreground: float = 0.0
    dssim: float = 0.0
    perceptual: float = 0.05
    mask: float = 0.1
    depth: float = 0.5
    background: float = 0.1
    decay: float = 0.9
    behind: Literal["white", "random"] = "white"


@dataclass(frozen=True)
class SceneConfig:
    """What of a scene an update sees.

    views: fewest and most that the reconstructor gets, drawn among those that count.
    targets: of each scene, drawn.
    """

    views: tuple[int, int] = (3, 6)
    targets: int = 2

    def __post_init__(self) -> None:
        if not 1 <= self.views[0] <= self.views[1] or self.targets < 1:
            raise UserError(
                "out-of-range", f"views {self.views}, targets {self.targets}", "use 1 or more, fewest first"
            )


@pytree_dataclass
class Targets:
    """What an object truly looks like.

    rgb: sRGB times coverage. mask: coverage. relief: depth less the camera's distance from the origin, metres.
    """

    rgb: Float[Array, "*batch target size size 3"]
    mask: Float[Array, "*batch target size size"]
    relief: Float[Array, "*batch target size size"]
    camera: Camera


Scene = tuple[View, Bool[Array, "_"], Targets]
"""Views, which of them count, and targets."""


def scene_arrays(scenes: ViewSet, index: Int[np.ndarray, "chosen"]) -> tuple[np.ndarray, ...]:
    """Scenes as they are sent to a device: bytes stay bytes."""
    names = ("rgb", "mask", "valid", "K", "world_from_cam")
    targets = ("target_rgb", "target_mask", "target_relief", "target_K", "target_world_from_cam")
    return tuple(getattr(scenes, name)[index] for name in (*names, *targets))


def unpacked(arrays: tuple[Array, ...]) -> Scene:
    """One scene of `scene_arrays`."""
    rgb, mask, valid, K, pose, target_rgb, target_mask, relief, target_K, target_pose = arrays
    size = rgb.shape[-2]

    def share(values: Array) -> Array:
        return values.astype(jnp.float32) / 255.0

    targets = Targets(
        share(target_rgb), share(target_mask), relief.astype(jnp.float32), Camera(target_K, target_pose, size, size)
    )
    return View(share(rgb), share(mask), Camera(K, pose, size, size)), valid, targets


def drawn(scene: Scene, config: SceneConfig, *, key: Key[Array, ""]) -> Scene:
    """The scene with some of its views, in random order in `config.views[1]` slots, and some of its targets."""
    order_key, count_key, target_key = jax.random.split(key, 3)
    views, valid, targets = scene
    fewest, slots = config.views[0], min(config.views[1], len(valid))
    order = jnp.argsort(jnp.where(valid, jax.random.uniform(order_key, valid.shape), 2.0))[:slots]
    most = jnp.clip(jnp.sum(valid), 1, slots)
    count = jax.random.randint(count_key, (), jnp.minimum(fewest, most), most + 1)
    seen = jax.random.permutation(target_key, targets.mask.shape[0])[: config.targets]
    used = jnp.arange(slots) < count
    return jax.tree.map(lambda x: x[order], views), used, jax.tree.map(lambda x: x[seen], targets)


def window_width(camera: Camera) -> Float[Array, "*batch"]:
    """Metres that an image is wide at the origin's distance."""
    return jnp.linalg.norm(camera.world_from_cam[..., :3, 3], axis=-1) * camera.width / camera.K[..., 0, 0]


def drawn_over(gaussians: Gaussians, targets: Targets, behind: Float[Array, "target 3"]) -> Rendering:
    """Gaussians in the targets' cameras, in float32 whatever made them."""
    return render(gaussians, targets.camera, background=behind, antialias=True)


def rendering_loss(
    seen: Rendering,
    targets: Targets,
    behind: Float[Array, "target 3"],
    config: LossConfig,
    perceptual: Perceptual | None,
) -> Float[Array, ""]:
    """Thesis Eq. 5.2 of one scene's renderings; see `LossConfig`."""
    image = targets.rgb + (1 - targets.mask[..., None]) * behind[:, None, None, :]
    squares = (seen.colour - image) ** 2
    loss = config.colour * jnp.mean(squares) + config.mask * jnp.mean((seen.alpha - targets.mask) ** 2)
    if config.foreground:
        on = jnp.broadcast_to((targets.mask > 0.5)[..., None], squares.shape).astype(squares.dtype)
        loss += config.foreground * jnp.sum(on * squares) / jnp.maximum(jnp.sum(on), 1.0)
    if config.dssim:
        loss += config.dssim * (1 - structural_similarity(seen.colour, image))
    if perceptual is not None and config.perceptual:
        loss += config.perceptual * jnp.mean(perceptual(seen.colour, image))
    if config.depth:
        loss += config.depth * _depth_loss(seen, targets, config.background)
    return loss


def _depth_loss(seen: Rendering, targets: Targets, background: float) -> Float[Array, ""]:
    """Mean over targets; a place off the object is right at the far plane."""
    width = window_width(targets.camera)[:, None, None]
    away = jnp.linalg.norm(targets.camera.world_from_cam[:, :3, 3], axis=-1)[:, None, None]
    found = (seen.depth - seen.alpha * away) / width + (1 - seen.alpha) * FAR
    on = (targets.mask > 0.5).astype(found.dtype)
    # At an edge, a rendering of the truth mixes both depths, too.
    wrong = jnp.abs(found - (targets.mask * targets.relief / width + (1 - targets.mask) * FAR))

    def mean(weight: Array) -> Array:
        return jnp.sum(weight * wrong, axis=(1, 2)) / jnp.maximum(jnp.sum(weight, axis=(1, 2)), 1.0)

    return jnp.mean(mean(on) + background * mean(1 - on))


@dataclass(frozen=True)
class ReconstructionTask:
    """The scenes of a run and how they are used; `perceptual` is None where its weight is 0 or nothing is named."""

    train: ViewSet
    val: ViewSet
    scenes: SceneConfig
    weights: LossConfig
    training: TrainingConfig
    seed: int
    perceptual: Perceptual | None = None

    def loss(self, member: TrainableReconstructor, batch: Any, keys: Key[Array, "scene"]) -> Float[Array, ""]:
        """Mean over scenes of the refinement steps' losses, each weighing `decay` times the next."""

        def one(arrays: tuple[Array, ...], key: Array) -> Array:
            draw, colour = jax.random.split(key)
            views, valid, targets = drawn(unpacked(arrays), self.scenes, key=draw)
            behind = jnp.ones((targets.mask.shape[0], 3))
            if self.weights.behind == "random":
                behind = jax.random.uniform(colour, behind.shape)
            steps = learned(member.steps(views, valid))
            losses = [
                rendering_loss(drawn_over(step, targets, behind), targets, behind, self.weights, self.perceptual)
                for step in steps
            ]
            shares = self.weights.decay ** np.arange(len(steps) - 1, -1, -1)
            return jnp.stack(losses) @ jnp.asarray(shares / shares.sum(), jnp.float32)

        return jnp.mean(jax.vmap(one)(batch, keys))

    def batches(self, epoch: int) -> Iterator[Any]:
        """This process' share of each batch of an epoch."""
        for index in epoch_order(len(self.train), self.training.batch, seed=self.seed, epoch=epoch):
            yield scene_arrays(self.train, own_share(index))

    def validate(self, member: TrainableReconstructor) -> dict[str, float]:
        """Figures of the validation scenes' targets, of the answer and of where the member starts."""
        rows = [
            jax.tree.map(np.asarray, _validated(member, scene_arrays(self.val, np.arange(i, i + 1)), self.scenes))
            for i in range(len(self.val))
        ]
        mean = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
        return {**mean, "score": mean["surround_psnr_db"]}

    @property
    def steps_per_epoch(self) -> int:
        """Whole batches of the training scenes."""
        return len(self.train) // self.training.batch


def learned(steps: tuple[Gaussians, ...]) -> tuple[Gaussians, ...]:
    """The steps that parameters have a part in: all but the start, if there is more than it."""
    return steps[1:] or steps


@jax.jit(static_argnames="config")
def _validated(
    member: TrainableReconstructor, arrays: tuple[Array, ...], config: SceneConfig
) -> dict[str, Float[Array, ""]]:
    """Figures of one scene, seen by as many of its views as training uses at most."""
    views, valid, targets = unpacked(jax.tree.map(lambda x: x[0], arrays))
    order = jnp.argsort(~valid, stable=True)[: min(config.views[1], len(valid))]
    steps = member.steps(jax.tree.map(lambda x: x[order], views), valid[order])
    behind = jnp.ones((targets.mask.shape[0], 3))
    image = targets.rgb + (1 - targets.mask[..., None]) * behind[:, None, None, :]
    first, last = (drawn_over(step, targets, behind) for step in (steps[0], steps[-1]))
    around = dilate((targets.mask > 0.5).astype(targets.mask.dtype), targets.camera.width // SURROUND)

    def psnr(seen: Rendering, mask: Array) -> Array:
        return jnp.mean(jax.vmap(peak_signal_to_noise)(seen.colour, image, mask))

    return {
        "surround_psnr_db": psnr(last, around),
        "start_surround_psnr_db": psnr(first, around),
        "psnr_db": psnr(last, targets.mask),
        "start_psnr_db": psnr(first, targets.mask),
        "ssim": structural_similarity(last.colour, image),
        "mask_error": jnp.mean((last.alpha - targets.mask) ** 2),
    }


def train_reconstructor(
    model: TrainableConfig,
    task: ReconstructionTask,
    *,
    directory: Path,
    report: Callable[[dict[str, float]], None],
    watch: Callable[[int, dict[str, float]], None],
) -> TrainableReconstructor:
    """Train a member, or go on with the run that the directory holds.

    Args:
        model: what is trained; its parameters are drawn by the task's seed.
        task: scenes, loss and optimisation.
        directory: of checkpoints and history.
        report: called with the figures of each epoch.
        watch: called with each step's number and figures.

    Returns:
        The member with the best validation score.

    Raises:
        UserError: as `fit`.
    """
    member = model.untrained(key=jax.random.key(task.seed))
    todo = Fit(task.loss, task.batches, task.steps_per_epoch, task.validate, report, watch)
    return fit(member, todo, task.training, seed=task.seed, directory=directory)
