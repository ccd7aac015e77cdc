"""Speed and memory of the splatter: pixel-Gaussian pairs a second, whole steps, threads, linearity, twin, GPU."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from kernels.splat import blend as kernel
from kernels.splat import reference
from kernels.splat.launch import worker_threads
from kernels.splat.projection import TILE, Shape, Splats, project, usable

GAUSSIAN_ARGUMENTS = tuple(range(5))
REPEATS = 7


def make_scene(count: int, size: int, *, seed: int = 0, opacity: tuple[float, float] = (0.05, 0.8)) -> list[jax.Array]:
    """`count` Gaussians of 1-4 cm in a ball of about a metre, seen from 2 m: the arguments of `splat`."""
    rng = np.random.default_rng(seed)
    K = np.array([[size, 0, size / 2], [0, size, size / 2], [0, 0, 1]])
    camera_from_world = np.eye(4)
    camera_from_world[2, 3] = 2.0
    values = (
        rng.normal(0, 0.4, (count, 3)),
        rng.normal(size=(count, 4)),
        rng.uniform(0.01, 0.04, (count, 3)),
        rng.uniform(*opacity, count),
        rng.uniform(size=(count, 3)),
        K,
        camera_from_world,
        np.ones(3),
    )
    return [jnp.asarray(x, jnp.float32) for x in values]


def seconds(
    function: Callable[..., Any],
    *arguments: Any,
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """The fastest of several runs, after one that compiles."""
    jax.block_until_ready(function(*arguments))
    times = []
    for _ in range(repeats):
        start = clock()
        jax.block_until_ready(function(*arguments))
        times.append(clock() - start)
    return min(times)


def training_step(draw: Callable[..., Any], size: int) -> Callable[..., Any]:
    """A compiled loss and its gradient to all attributes of the Gaussians."""
    shape = Shape(size, size, 0.2, "inria", False)

    def loss(*arguments: Any) -> jax.Array:
        colour, depth, alpha, _ = draw(*arguments, shape=shape)
        return jnp.sum(colour * colour) + jnp.sum(depth) + jnp.sum(alpha)

    return jax.jit(jax.grad(loss, argnums=GAUSSIAN_ARGUMENTS))


def split_blend(arguments: list[jax.Array], size: int) -> tuple[Callable[[], Any], Callable[[], Any], int, int]:
    """Blending alone: forward, backward, pixel-Gaussian pairs that pixels visit before they end, and pairs listed."""
    mean, quaternion, scale, opacity, colour, K, camera_from_world, background = arguments
    shape = Shape(size, size, 0.2, "inria", False)
    finite = usable(mean, quaternion, scale, opacity, colour)
    compiled = jax.jit(project, static_argnames="shape")
    splats: Splats = compiled(mean, quaternion, scale, opacity, K, camera_from_world, finite, shape=shape)
    forward = jax.jit(lambda s, c, b: kernel._blend_forward(s, c, b, size, size, "inria"))
    images, saved = forward(splats, colour, background)
    backward = jax.jit(lambda saved, g: kernel._blend_backward(size, size, "inria", saved, g))
    cotangents = jax.tree.map(jnp.ones_like, images)
    widths = splats.rectangle[:, 2:] - splats.rectangle[:, :2]
    listed = int(jnp.sum(widths[:, 0] * widths[:, 1])) * TILE * TILE
    visited = int(jnp.sum(saved[3]))
    return lambda: forward(splats, colour, background), lambda: backward(saved, cotangents), visited, listed


def throughput(count: int, size: int, threads: int) -> dict[str, float]:
    """Million visited pairs a second, forward and backward (which builds its lists again).

    Per second of wall-clock time, and per second of processor time, which other programs on the machine disturb less.
    """
    with worker_threads(threads):
        forward, backward, visited, _ = split_blend(make_scene(count, size), size)
        return {
            "forward_Mpairs_per_s": visited / seconds(forward) / 1e6,
            "backward_Mpairs_per_s": visited / seconds(backward) / 1e6,
            "forward_Mpairs_per_cpu_s": visited / seconds(forward, clock=time.process_time) / 1e6,
            "backward_Mpairs_per_cpu_s": visited / seconds(backward, clock=time.process_time) / 1e6,
        }


def linearity() -> dict[str, Any]:
    """Processor time of blending forward and backward over a hundredfold range of listed pairs, and the log-log slope.

    Nearly transparent Gaussians, so that no pixel ends early and listed pairs are visited pairs.
    """
    rows = []
    for count in (4_000, 40_000, 400_000):
        arguments = make_scene(count, 256, opacity=(0.004, 0.0045))
        forward, backward, _, listed = split_blend(arguments, 256)
        both = [seconds(run, repeats=3, clock=time.process_time) for run in (forward, backward)]
        rows.append({"pairs": listed, "cpu_seconds": sum(both)})
    logs = np.log([[row["pairs"], row["cpu_seconds"]] for row in rows])
    return {"rows": rows, "slope": float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])}


def peak_bytes_per_gaussian(count: int = 500_000, size: int = 256) -> float | str:
    """Growth of this process's peak memory during one training step (Linux); call it in a fresh process."""
    arguments, small = make_scene(count, size), make_scene(64, size)
    step = training_step(kernel.splat, size)
    compiled = step.lower(*arguments).compile()  # type: ignore[attr-defined]
    jax.block_until_ready(step(*small))  # kernels, thread pools
    try:
        Path("/proc/self/clear_refs").write_text("5")  # forget the peak so far, which is the compiler's
    except OSError:
        return "not measured (needs Linux)"
    before = _status_kilobytes("VmRSS")
    jax.block_until_ready(compiled(*arguments))
    return (_status_kilobytes("VmHWM") - before) * 1024 / count


def _status_kilobytes(name: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))


def _in_fresh_process(expression: str) -> float | str:
    command = [sys.executable, "-c", f"from experiments._benchmarks import splat; print(splat.{expression})"]
    last = subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip().splitlines()[-1]
    try:
        return float(last)
    except ValueError:
        return last


def gpu(count: int = 1_000_000, width: int = 1920, height: int = 1080) -> dict[str, Any] | str:
    """A million Gaussians at 1920×1080 on CUDA; `python -m experiments.benchmark splat` on a GPU machine fills this."""
    if jax.default_backend() != "gpu":
        return "not measured (no CUDA device)"
    arguments = make_scene(count, 1080)
    arguments[2] = arguments[2] * 0.2
    arguments[5] = arguments[5].at[0, 2].set(width / 2)
    shape = Shape(width, height, 0.2, "gsplat", False)
    forward = jax.jit(lambda *a: kernel.splat(*a, shape=shape)[0])
    step = jax.jit(jax.grad(lambda *a: jnp.sum(kernel.splat(*a, shape=shape)[0] ** 2), argnums=GAUSSIAN_ARGUMENTS))
    ours = {"forward_s": seconds(forward, *arguments), "forward_backward_s": seconds(step, *arguments)}
    return {"aerojax": ours, "gsplat": gsplat_on_gpu(arguments, width, height)}


def gsplat_on_gpu(arguments: list[jax.Array], width: int, height: int) -> dict[str, float] | str:
    """The same scene through gsplat, where torch, gsplat and CUDA are present."""
    try:
        import torch  # pyrefly: ignore
        from gsplat import rasterization  # pyrefly: ignore
    except ImportError:
        return "not measured (torch or gsplat is not installed)"
    tensors = [torch.tensor(np.asarray(x), device="cuda") for x in arguments]
    mean, quaternion, scale, opacity, colour, K, view, background = tensors
    leaves = [x.requires_grad_() for x in (mean, quaternion, scale, opacity, colour)]

    def forward() -> Any:
        options = {"backgrounds": background[None], "near_plane": 0.2, "packed": False}
        images, _, _ = rasterization(*leaves, view[None], K[None], width, height, **options)
        torch.cuda.synchronize()
        return images

    def step() -> None:
        torch.sum(forward() ** 2).backward()
        torch.cuda.synchronize()

    timed = {}
    for name, function in (("forward_s", forward), ("forward_backward_s", step)):
        function()
        times = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            function()
            times.append(time.perf_counter() - start)
        timed[name] = min(times)
    return timed


def measure() -> dict[str, Any]:
    """All figures; about a minute on two quiet cores. Times are the fastest of several runs."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    one, two = throughput(16_384, 256, 1), throughput(16_384, 256, 2)
    small, twin = make_scene(4_096, 64), make_scene(1_024, 64)
    ours = seconds(training_step(kernel.splat, 64), *twin)
    plain = seconds(training_step(reference.splat, 64), *twin, repeats=2)
    return {
        "cores": cores,
        "load_average": os.getloadavg()[0],
        "one_thread": one,
        "two_threads": two,
        "speed_up_forward": two["forward_Mpairs_per_s"] / one["forward_Mpairs_per_s"],
        "speed_up_backward": two["backward_Mpairs_per_s"] / one["backward_Mpairs_per_s"],
        "4096_at_64_forward_backward_ms": 1e3 * seconds(training_step(kernel.splat, 64), *small),
        "16384_at_256_forward_backward_ms": 1e3 * seconds(training_step(kernel.splat, 256), *make_scene(16_384, 256)),
        "1024_at_64_times_faster_than_plain_jax": plain / ours,
        "linearity": linearity(),
        "peak_bytes_per_gaussian": _in_fresh_process("peak_bytes_per_gaussian()"),
        "gpu_1M_at_1920x1080": gpu(),
    }
