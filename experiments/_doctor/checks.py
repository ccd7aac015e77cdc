"""Each check tries what it speaks of: kernels are compiled and compared, codecs write and read pictures back."""

from __future__ import annotations

import importlib.util
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import warp as wp

from aerojax import __version__
from aerojax.core.provenance import commit, package_versions
from aerojax.core.types import Camera, Gaussians
from aerojax.gaussians.render import render
from aerojax.geometry.cameras import look_at

State = Literal["ok", "absent", "broken"]
"""absent: something optional that is not there. broken: something needed that does not work."""
EXTRAS = {
    "log": ("tensorboardX",),
    "sweep": ("hydra_plugins.hydra_joblib_launcher",),
    "cluster": ("submitit", "ray"),
    "croissant": ("mlcroissant",),
    "perceptual": ("stlpips_pytorch",),
    "bench": ("torch",),
}
"""A module of each optional dependency group."""
_CLOSE = 2e-3
"""Greatest difference of colours between the compiled kernel and the plain one, of 1; rounding makes far less."""


@dataclass(frozen=True)
class Finding:
    """One line: of which part, what was found, and whether it is well. remedy: what helps; "" if nothing needs to."""

    part: str
    text: str
    state: State = "ok"
    remedy: str = ""


def findings() -> Iterator[Finding]:
    """Everything, cheap things first. A check that fails in a way nobody foresaw is a finding and ends no other."""
    for name, check in CHECKS.items():
        try:
            yield from check()
        except Exception as error:  # this act exists to report whatever goes wrong here
            yield Finding(name, f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}", "broken")


def _versions() -> Iterator[Finding]:
    yield Finding("aerojax", f"{__version__}, commit {commit() or 'unknown (installed)'}")
    yield Finding("versions", ", ".join(f"{name} {version}" for name, version in package_versions().items()))


def _machine() -> Iterator[Finding]:
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    yield Finding("machine", f"{platform.platform()}, {os.cpu_count()} CPUs, {memory:.0f} GB")


def _extras() -> Iterator[Finding]:
    for extra, modules in EXTRAS.items():
        lacking = [module for module in modules if not _is_there(module)]
        if lacking:
            remedy = f"pip install 'aerojax[{extra}]', if it is wanted"
            yield Finding(f"extra {extra}", f"without {', '.join(lacking)}", "absent", remedy)
        else:
            yield Finding(f"extra {extra}", "installed")


def _is_there(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:  # its package is not there
        return False


def _devices() -> Iterator[Finding]:
    for device in jax.devices():
        limit = (device.memory_stats() or {}).get("bytes_limit")
        yield Finding("JAX", f"{device.platform} {device.device_kind}" + (f", {limit / 2**30:.0f} GB" if limit else ""))
    wp.init()
    yield Finding("Warp", ", ".join(f"{device.alias} ({device.name})" for device in wp.get_devices()))
    if jax.default_backend() == "gpu" and not wp.is_cuda_available():
        yield Finding("Warp", "sees no CUDA device, JAX does", "broken", "install the Warp build for this CUDA driver")


def _kernels() -> Iterator[Finding]:
    start = time.perf_counter()
    difference = kernel_difference()
    spent = time.perf_counter() - start
    if difference <= _CLOSE:
        yield Finding("kernels", f"compile and agree with plain JAX to {difference:.1e} ({spent:.1f} s)")
    else:
        text = f"colours differ from those of plain JAX by {difference:.2g}"
        yield Finding("kernels", text, "broken", "delete Warp's cache of kernels and try again")


def kernel_difference() -> float:
    """Greatest difference between pictures that the compiled splatter and its plain twin draw of 64 Gaussians."""
    rng = np.random.default_rng(0)
    shapes = {"mean": (64, 3), "quaternion": (64, 4), "scale": (64, 3), "opacity": (64,), "sh": (64, 1, 3)}
    drawn = {name: rng.uniform(0.1, 0.4, shape) for name, shape in shapes.items()}
    gaussians = Gaussians(**{name: jnp.asarray(values, jnp.float32) for name, values in drawn.items()})
    K = jnp.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]])
    camera = Camera(K, jnp.asarray(look_at(np.array([2.0, 1.0, 1.0]), np.zeros(3)), jnp.float32), width=64, height=48)
    background = jnp.zeros(3)
    compiled = render(gaussians, camera, background=background, backend="warp").colour
    plain = render(gaussians, camera, background=background, backend="reference").colour
    return float(jnp.max(jnp.abs(compiled - plain)))


def _codecs() -> Iterator[Finding]:
    rng = np.random.default_rng(0)
    smooth = cv2.resize(rng.integers(0, 255, (4, 4, 3), dtype=np.uint8), (64, 48), interpolation=cv2.INTER_CUBIC)
    for kind in ("png", "jpg", "webp", "tiff"):
        works, data = cv2.imencode(f".{kind}", smooth)
        read = cv2.imdecode(data, cv2.IMREAD_COLOR) if works else None
        yield _codec(f"images .{kind}", read is not None and _alike(read, smooth), needed=kind in ("png", "jpg"))
    with tempfile.TemporaryDirectory() as folder:
        for codec, needed in (("mp4v", True), ("avc1", False), ("MJPG", False)):
            path = Path(folder) / f"{codec}.{'avi' if codec == 'MJPG' else 'mp4'}"
            yield _codec(f"video {codec}", _video_works(path, codec, smooth), needed=needed)


def _codec(part: str, works: bool, *, needed: bool) -> Finding:
    if works:
        return Finding(part, "written and read")
    return Finding(part, "cannot be written and read", "broken" if needed else "absent")


def _video_works(path: Path, codec: str, picture: np.ndarray) -> bool:
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # FFmpeg's own words about what it lacks
    height, width = picture.shape[:2]
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 30.0, (width, height))
        for _ in range(3):
            writer.write(picture)
        writer.release()
        read, frame = cv2.VideoCapture(str(path)).read()
    finally:
        cv2.utils.logging.setLogLevel(level)
    return bool(read) and _alike(frame, picture)


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and float(np.abs(a.astype(int) - b).mean()) < 12


_PROGRAMS = "jax_compilation_cache_dir"
"""The setting that names where JAX keeps compiled programs."""


def _caches() -> Iterator[Finding]:
    folders = {
        "compiled programs": getattr(jax.config, _PROGRAMS),
        "compiled kernels": wp.config.kernel_cache_dir,
    }
    for what, folder in folders.items():
        if folder:
            yield Finding("cache", f"{what}: {megabytes(Path(folder)):.0f} MB in {folder}")


def _places() -> Iterator[Finding]:
    try:
        with tempfile.TemporaryDirectory(dir=Path.cwd()):
            yield Finding("place", f"{Path.cwd()} can be written to")
    except OSError as error:
        yield Finding("place", f"{Path.cwd()}: {error.strerror}", "broken", "start in another folder")


def megabytes(folder: Path) -> float:
    """Size of all files below a folder; 0 for one that is not there."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 2**20


CHECKS: dict[str, Callable[[], Iterator[Finding]]] = {
    "versions": _versions,
    "machine": _machine,
    "extras": _extras,
    "place": _places,
    "codecs": _codecs,
    "devices": _devices,
    "kernels": _kernels,
    "caches": _caches,
}
"""By name, in the order in which they are made."""
