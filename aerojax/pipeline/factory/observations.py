"""What the cameras of a planned clip see of the object: silhouettes and crops, from the window of rays alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Float64, Int

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Box
from aerojax.data.clips import VIEWS
from aerojax.geometry.boxes import tight_box, touches_border
from aerojax.geometry.triangulation import intersect_rays
from aerojax.pipeline.factory.config import FactoryConfig
from aerojax.pipeline.factory.plan import ClipPlan
from aerojax.reconstruct.crop import Crop, CropSource, crop_cameras, crop_part, crop_source
from aerojax.reconstruct.cut_views import FEWEST_WHOLE, SeenBoxes, aimed_boxes, centre_on_ray, known_pixels
from aerojax.segment.silhouettes import FEWEST_PIXELS
from aerojax.simulate.render.image import Window
from aerojax.simulate.render.window import WindowRenderer
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from aerojax.simulate.world.sensor import expose


@dataclass(frozen=True, eq=False)
class Sight:
    """The object in one camera's image, nothing of which exists but a window.

    window: x0 y0 x1 y1 of the arrays, ends exclusive.
    rgb: sRGB, 0..1. mask: after threshold and growth. background: sRGB around the window.
    box: of the mask, pixels of the image.
    whole: whether it keeps clear of the image's border.
    """

    window: Window
    rgb: Float32[np.ndarray, "rows columns 3"]
    mask: Bool[np.ndarray, "rows columns"]
    background: Float[np.ndarray, "3"]
    box: Box
    whole: bool


@dataclass(frozen=True, eq=False)
class ClipCrops:
    """Crops of every frame, padded to `VIEWS` views; cameras in frames with the rig's axes and the object at 0.

    numbers: of the frames in the clip's plan.
    rgb: sRGB. mask: coverage. valid: views that count. cut: those of them whose border cuts the object.
    known: as in `View`; None where no view is cut.
    K, crop_from_cam: of the virtual cameras, float64; the second is `world_from_cam` in the crop's frame.
    rig_from_crop: places of the crops' frames, metres. world_from_rig: rigid.
    width_px: longer sides of the boxes of views that are not cut, median over the clip; distance_m: from the cameras,
        median.
    """

    numbers: Int[np.ndarray, "time"]
    rgb: Float32[np.ndarray, "time view size size 3"]
    mask: Float32[np.ndarray, "time view size size"]
    valid: Bool[np.ndarray, "time view"]
    cut: Bool[np.ndarray, "time view"]
    known: Bool[np.ndarray, "time view size size"] | None
    K: Float64[np.ndarray, "time view 3 3"]
    crop_from_cam: Float64[np.ndarray, "time view 4 4"]
    rig_from_crop: Float64[np.ndarray, "time 3"]
    world_from_rig: Float64[np.ndarray, "4 4"]
    width_px: float
    distance_m: float


def see_clip(plan: ClipPlan, mesh: AnimatedMesh, config: FactoryConfig) -> list[list[Sight | None]]:
    """Render every frame's windows: a list a frame, one entry a camera, None where it shows next to nothing."""
    images = replace(config.images, mask_threshold=plan.faults.mask_threshold)
    window, posed, frames = WindowRenderer(mesh, plan.environment, images), None, []
    for frame in range(config.frames):
        sights = []
        for camera in plan.cameras:
            moment = frame + camera.time_offset_s * plan.fps
            if posed != moment:
                window.pose(*plan.pose_at(moment))
                posed = moment
            sights.append(_sight(window, camera, plan.faults.mask_growth))
        frames.append(sights)
    return frames


def _sight(renderer: WindowRenderer, camera: CaptureCamera, growth: int) -> Sight | None:
    image = renderer.image(camera)
    if image is None:
        return None
    window, mask = _grown(image.mask, image.window, growth, camera)
    box = tight_box(mask, min_pixels=FEWEST_PIXELS)
    if box is None:
        return None
    placed = (box[0] + window[0], box[1] + window[1], box[2] + window[0], box[3] + window[1])
    rgb = _fitted(image.rgb, image.window, window, image.background)
    whole = not touches_border(placed, camera.width, camera.height)
    return Sight(window, rgb, mask, image.background, placed, whole)


def _grown(
    mask: Bool[np.ndarray, "rows columns"], window: Window, growth: int, camera: CaptureCamera
) -> tuple[Window, Bool[np.ndarray, "_ _"]]:
    """The mask dilated or eroded by pixels, four neighbours a step, in a window that holds it."""
    if growth == 0:
        return window, mask
    reach = max(growth, 0)
    x0, y0, x1, y1 = window
    wide = (max(x0 - reach, 0), max(y0 - reach, 0), min(x1 + reach, camera.width), min(y1 + reach, camera.height))
    bits = _fitted(mask.astype(np.uint8), window, wide, np.zeros((), np.uint8))
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    if growth > 0:
        return wide, cv2.dilate(bits, cross, iterations=growth) > 0
    return wide, cv2.erode(bits, cross, iterations=-growth, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0


def _fitted(values: np.ndarray, window: Window, wanted: Window, around: np.ndarray) -> np.ndarray:
    """The values of one window in another one; `around` where the first does not reach."""
    x0, y0, x1, y1 = wanted
    out = np.empty((y1 - y0, x1 - x0, *values.shape[2:]), values.dtype)
    out[:] = around
    left, top, right, bottom = max(window[0], x0), max(window[1], y0), min(window[2], x1), min(window[3], y1)
    if right > left and bottom > top:
        part = values[top - window[1] : bottom - window[1], left - window[0] : right - window[0]]
        out[top - y0 : bottom - y0, left - x0 : right - x0] = part
    return out


def crop_clip(
    frames: list[list[Sight | None]], plan: ClipPlan, config: FactoryConfig, *, cut_views: bool = True
) -> ClipCrops | None:
    """Cut the crops of every usable frame as `reconstruct.observe` does; None where there is none.

    Args:
        frames: from `see_clip`.
        plan: of the clip.
        config: of the factory.
        cut_views: whether cameras that show a part of the object count, if the reconstructor heeds what they do not
            show.
    """
    whole, partly = (np.zeros((len(frames), VIEWS), bool) for _ in range(2))
    for frame, sights in enumerate(frames):
        whole[frame, : len(sights)] = [one is not None and one.whole for one in sights]
        partly[frame, : len(sights)] = [one is not None and not one.whole for one in sights]
    partly &= (whole.sum(axis=1) >= FEWEST_WHOLE)[:, None] & (cut_views and config.pipeline.reconstruct.reads_known)
    used = np.flatnonzero((whole | partly).sum(axis=1) >= config.pipeline.min_views)
    if not len(used):
        return None
    world_from_rig = plan.calibration[0].world_from_cam
    rig_from_world = np.linalg.inv(world_from_rig)
    poses = _padded(np.stack([rig_from_world @ camera.world_from_cam for camera in plan.calibration]))
    K = _padded(np.stack([camera.K for camera in plan.calibration]))
    sizes = np.array([(camera.width, camera.height) for camera in plan.calibration], np.float64)
    several = _Cameras(K, poses, _padded(sizes), config.frames, config.pipeline.crop_size)
    crops, centres, boxes, cut = _aim(several, [frames[f] for f in used], whole[used], partly[used])
    enough = (whole[used] | cut).sum(axis=1) >= config.pipeline.min_views
    if not enough.any():
        return None
    used, cut, boxes, centres = used[enough], cut[enough], boxes[enough], centres[enough]
    crops = jax.tree.map(lambda leaf: leaf[enough], crops)
    whole, homographies = whole[used], np.asarray(crops.crop_from_image)
    valid, seen = whole | cut, [frames[f] for f in used]
    rgb, mask = _pixels(seen, used, valid, homographies, plan, config)
    in_crop = np.array(crops.camera.world_from_cam)
    in_crop[..., :3, 3] -= centres[:, None]
    return ClipCrops(
        used,
        rgb,
        mask,
        valid,
        cut,
        _known(homographies, cut, plan, config.pipeline.crop_size),
        np.asarray(crops.camera.K),
        in_crop,
        centres,
        world_from_rig,
        float(np.median(np.maximum(boxes[..., 2] - boxes[..., 0], boxes[..., 3] - boxes[..., 1])[whole])),
        float(np.median(np.linalg.norm(in_crop[..., :3, 3], axis=-1)[whole])),
    )


@dataclass(frozen=True, eq=False)
class _Cameras:
    """Of a clip, padded to `VIEWS`: K, poses in the rig's frame, sizes of images; frames and sides of crops."""

    K: Float64[np.ndarray, "view 3 3"]
    poses: Float64[np.ndarray, "view 4 4"]
    sizes: Float64[np.ndarray, "view 2"]
    frames: int
    size: int


def _padded(values: Float64[np.ndarray, "camera *shape"]) -> Float64[np.ndarray, "view *shape"]:
    """One entry a view; views without a camera have the first one's."""
    return values[[*range(len(values)), *[0] * (VIEWS - len(values))]]


def _stretched(values: np.ndarray, frames: int) -> np.ndarray:
    """One entry a usable frame, the last repeated: one length for every clip is compiled once."""
    return np.concatenate([values, np.repeat(values[-1:], frames - len(values), axis=0)])


def _boxes(sights: list[Sight | None], chosen: Bool[np.ndarray, "view"]) -> Float64[np.ndarray, "view 4"]:
    """Boxes of the chosen views; the others have the first one's, because arrays have one shape."""
    found = {view: one.box for view, one in enumerate(sights) if one is not None and chosen[view]}
    first = next(iter(found.values()))
    return np.array([found.get(view, first) for view in range(VIEWS)], np.float64)


def _aim(
    cameras: _Cameras,
    frames: list[list[Sight | None]],
    whole: Bool[np.ndarray, "time view"],
    partly: Bool[np.ndarray, "time view"],
) -> tuple[Crop, Float64[np.ndarray, "time 3"], Float64[np.ndarray, "time view 4"], Bool[np.ndarray, "time view"]]:
    """Virtual cameras of every frame and view in the rig's frame, where the rays of whole views meet, the boxes that
    the cameras look at, and which views that show a part are used."""
    boxes = np.stack([_boxes(one, use) for one, use in zip(frames, whole, strict=True)])
    crops = _look(cameras, boxes)
    centres, cut = np.zeros((len(frames), 3)), np.zeros_like(partly)
    several = whole.sum(axis=1) > 1
    centres[several] = _meeting(cameras, np.asarray(crops.ray)[several], whole[several])
    for frame in np.flatnonzero(partly.any(axis=1)):
        shown = _boxes(frames[frame], whole[frame] | partly[frame])
        seen = SeenBoxes(cameras.K, cameras.poses, cameras.sizes, shown, whole[frame], partly[frame])
        centre = centres[frame] if several[frame] else centre_on_ray(seen)
        if centre is not None:
            centres[frame] = centre
            boxes[frame], cut[frame] = aimed_boxes(seen, centre)
    return (_look(cameras, boxes) if cut.any() else crops), centres, boxes, cut


def _look(cameras: _Cameras, boxes: Float64[np.ndarray, "time view 4"]) -> Crop:
    frames, many = cameras.frames, _stretched(boxes, cameras.frames)
    K, poses = np.tile(cameras.K, (frames, 1, 1)), np.tile(cameras.poses, (frames, 1, 1))
    flat = crop_cameras(K, poses, many.reshape(-1, 4), size=cameras.size)
    return jax.tree.map(lambda leaf: leaf.reshape(frames, VIEWS, *leaf.shape[1:])[: len(boxes)], flat)


def _meeting(
    cameras: _Cameras, rays: Float64[np.ndarray, "time view 3"], whole: Bool[np.ndarray, "time view"]
) -> Float64[np.ndarray, "time 3"]:
    if not len(rays):
        return np.zeros((0, 3))
    rays, weights = (_stretched(values, cameras.frames) for values in (rays, whole.astype(np.float64)))
    with jax.enable_x64(True):
        places = (jnp.asarray(values) for values in (cameras.poses[:, :3, 3], rays, weights))
        return np.asarray(_meet(*places))[: len(whole)]


def _known(
    homographies: Float64[np.ndarray, "time view 3 3"],
    cut: Bool[np.ndarray, "time view"],
    plan: ClipPlan,
    size: int,
) -> Bool[np.ndarray, "time view size size"] | None:
    if not cut.any():
        return None
    known = np.ones((*cut.shape, size, size), bool)
    for time, view in np.argwhere(cut):
        camera = plan.cameras[view]
        image_size = (camera.width, camera.height)
        known[time, view] = known_pixels(homographies[time, view], size=size, image_size=image_size)
    return known


@jax.jit
def _meet(
    origins: Float[Array, "view 3"], rays: Float[Array, "time view 3"], weights: Float[Array, "time view"]
) -> Float[Array, "time 3"]:
    return jax.vmap(lambda r, w: intersect_rays(origins, r, w))(rays, weights)


def _pixels(
    frames: list[list[Sight | None]],
    numbers: np.ndarray,
    valid: np.ndarray,
    homographies: Float[np.ndarray, "time view 3 3"],
    plan: ClipPlan,
    config: FactoryConfig,
) -> tuple[Float32[np.ndarray, "time view size size 3"], Float32[np.ndarray, "time view size size"]]:
    size = config.pipeline.crop_size
    rgb = np.zeros((len(frames), VIEWS, size, size, 3), np.float32)
    mask = np.zeros((len(frames), VIEWS, size, size), np.float32)
    for time, sights in enumerate(frames):
        for view, one in enumerate(sights):
            if one is None or not valid[time, view]:
                continue
            camera, homography = plan.cameras[view], homographies[time, view]
            source = crop_source(homography, size=size, image_size=(camera.width, camera.height))
            rng = np.random.default_rng([plan.noise_seed, view, int(numbers[time])])
            part = np.concatenate([_recorded(one, source, plan, view, rng), _mask_part(one, source)], axis=-1)
            both = crop_part(part, source, homography, size=size)
            rgb[time, view], mask[time, view] = both[..., :3], both[..., 3]
    return rgb, mask


def _mask_part(one: Sight, source: CropSource) -> Float32[np.ndarray, "rows columns 1"]:
    bits = _fitted(one.mask, one.window, source.window, np.zeros((), bool))
    return bits[..., None].astype(np.float32)


def _recorded(
    one: Sight, source: CropSource, plan: ClipPlan, view: int, rng: np.random.Generator
) -> Float32[np.ndarray, "rows columns 3"]:
    """The window as the sensor stores it in bytes."""
    part = expose(_fitted(one.rgb, one.window, source.window, one.background), plan.sensors[view], rng=rng)
    return (np.round(np.clip(part, 0.0, 1.0) * 255.0) / 255.0).astype(np.float32)
