"""Scenes that a reconstructor learns from: crops as the pipeline cuts them, and the object as it is from elsewhere.

Half of the objects are solids of no class, so that what is learned is shape and not four classes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from aerojax.capture.format import CaptureCamera
from aerojax.core.colour import srgb_from_linear
from aerojax.core.errors import UserError
from aerojax.core.seeds import number_of
from aerojax.core.types import CLASSES
from aerojax.data.splits import Split
from aerojax.geometry.cameras import points_in_camera
from aerojax.geometry.directions import golden_spiral
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.factory.config import FactoryConfig, FaultRanges, FlightRanges, Range, RigRanges, uniform
from aerojax.pipeline.factory.observations import ClipCrops, crop_clip, see_clip
from aerojax.pipeline.factory.plan import ClipPlan, plan_clip
from aerojax.pipeline.factory.write import individuals_of
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import Identity
from aerojax.simulate.assets.solids.asset import build_solid, solid_name
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.render.window import WindowRenderer
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from aerojax.simulate.world.rigs import aimed_camera

SOLID = "solid"
"""Kind of what has no class."""
_NEAREST = 0.05
"""Metres before a target's camera that every vertex must be."""
TARGET_IMAGES = ImageConfig(depth=False, rays_across=512)
"""At least three samples along a pixel's side: targets are judged by, so their edges are smooth."""


@dataclass(frozen=True, kw_only=True)
class ViewsConfig:
    """What decides the scenes.

    seed: of everything but the individuals themselves.
    split: whose families are seen; solids of a split are a series of their own.
    objects: how many; more extend the list and change none of it.
    solids: share of them that are solids of no class.
    poses: scenes of each object.
    targets: views of each scene that nothing is reconstructed from.
    near: share of the targets that lie between the cameras, or up to `apart_deg` off them; the others are spread evenly
        over the sphere, which is turned at random.
    apart_deg: see `near`.
    margin: window of a target over the object in it.
    size: side of all images, pixels.
    attempts: draws of a scene before it is given up.
    rigs, flights, faults: of the cameras, as in clips.
    """

    seed: int = 0
    split: Split = "train"
    objects: int = 1000
    solids: float = 0.5
    poses: int = 2
    targets: int = 4
    near: float = 0.5
    apart_deg: float = 35.0
    margin: Range = (1.1, 1.5)
    size: int = 64
    attempts: int = 8
    rigs: RigRanges = field(default_factory=lambda: RigRanges(width_px=(16.0, 200.0)))
    flights: FlightRanges = field(default_factory=FlightRanges)
    faults: FaultRanges = field(
        default_factory=lambda: FaultRanges(
            rotation_deg=(0.0, 0.1),
            position_m=(0.0, 0.0),
            focal_percent=(0.0, 0.2),
            clock_ms=(0.0, 0.0),
            lost=(0, 0),
            mask_growth=(0, 1),
            sensor=(0.0, 0.3),
        )
    )

    def __post_init__(self) -> None:
        if min(self.objects, self.poses, self.targets, self.attempts) < 1 or self.size < 16:
            counts = f"objects {self.objects}, poses {self.poses}, targets {self.targets}, size {self.size}"
            raise UserError("out-of-range", counts, "use 1 or more, and images of at least 16 pixels")
        if not 0.0 <= self.solids <= 1.0 or not 0.0 <= self.near <= 1.0:
            raise UserError("out-of-range", f"solids is {self.solids}, near {self.near}", "shares lie in 0..1")

    @property
    def clip(self) -> FactoryConfig:
        """A clip of one frame, which a scene is."""
        return FactoryConfig(
            seed=self.seed,
            split=self.split,
            frames=1,
            least_frames=1,
            rigs=self.rigs,
            flights=self.flights,
            faults=self.faults,
            pipeline=PipelineConfig(crop_size=self.size),
        )


def fibonacci_directions(count: int) -> Float64[np.ndarray, "view 3"]:
    """Unit, even on the sphere, from the top down."""
    return golden_spiral(1 - (2 * np.arange(count) + 1) / count)


def objects_of(config: ViewsConfig) -> tuple[Identity, ...]:
    """Who is seen; a larger number extends the list."""
    flyers = individuals_of(replace(config.clip, individuals=math.ceil(config.objects / len(CLASSES))))
    found, solids = [], 0
    for number in range(config.objects):
        if math.floor((number + 1) * config.solids) > solids:
            name = solid_name(solids, number_of(config.split, SOLID) % 1000)
            found.append(Identity(name, SOLID, SOLID, 0, config.split))
            solids += 1
        else:
            found.append(flyers[number - solids])
    return tuple(found)


def scenes_of(identity: Identity, config: ViewsConfig) -> Iterator[dict[str, np.ndarray | str]]:
    """An object's scenes by the names of `ViewSet`'s fields; those of which no attempt was usable are left out."""
    mesh = build_solid(identity.name) if identity.label == SOLID else build_animated(identity)
    for pose in range(config.poses):
        name = f"{identity.name}_v{pose:02d}"
        tries = (_scene(identity, mesh, name, attempt, config) for attempt in range(config.attempts))
        scene = next((one for one in tries if one is not None), None)
        if scene is not None:
            yield scene


def _scene(
    identity: Identity, mesh: AnimatedMesh, name: str, attempt: int, config: ViewsConfig
) -> dict[str, np.ndarray | str] | None:
    clip = config.clip
    if identity.label == SOLID:
        clip = replace(clip, flights=replace(clip.flights, in_place=1.0))
    plan = plan_clip(identity, mesh, name, attempt, clip)
    seen = see_clip(plan, mesh, clip)
    crops = crop_clip(seen, plan, clip, cut_views=False)
    if crops is None:
        return None
    faults = plan.faults
    right = not any((faults.rotation_deg, faults.position_m, faults.focal_percent))
    exact = crops if right else crop_clip(seen, replace(plan, calibration=plan.cameras), clip, cut_views=False)
    assert exact is not None
    rng = np.random.default_rng(number_of(config.seed, name, attempt, "targets"))
    targets = _targets(plan, mesh, crops, exact, config, rng)
    if targets is None:
        return None
    return {**_contexts(crops), **targets, "name": name, "kind": identity.label, "rig": plan.kind}


def _contexts(crops: ClipCrops) -> dict[str, np.ndarray]:
    return {
        "rgb": _bytes(crops.rgb[0]),
        "mask": _bytes(crops.mask[0]),
        "valid": crops.valid[0],
        "K": crops.K[0].astype(np.float32),
        "world_from_cam": crops.crop_from_cam[0].astype(np.float32),
        "width_px": np.asarray(crops.width_px, np.float32),
    }


def _bytes(values: np.ndarray) -> np.ndarray:
    return np.round(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8)


def _targets(
    plan: ClipPlan,
    mesh: AnimatedMesh,
    crops: ClipCrops,
    exact: ClipCrops,
    config: ViewsConfig,
    rng: np.random.Generator,
) -> dict[str, np.ndarray] | None:
    """Images of the object alone from cameras around it; None where one of them cannot see it.

    The crop's frame is where the stated calibration puts the object. Where that is wrong, the object stands in it as in
    the true cameras' own crop frame: both have the first camera's axes and their origins on one point of the object.
    """
    seconds, pose = plan.pose_at(0.0)
    world_from_crop = plan.cameras[0].world_from_cam.copy()
    world_from_crop[:3, 3] = (world_from_crop @ np.append(exact.rig_from_crop[0], 1.0))[:3]
    renderer = WindowRenderer(mesh, plan.environment, TARGET_IMAGES)
    renderer.pose(seconds, pose)
    vertices = mesh.vertices_at(seconds).astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    centres = crops.crop_from_cam[0][crops.valid[0]][:, :3, 3] @ world_from_crop[:3, :3].T
    near, found = round(config.near * config.targets), []
    turn = Rotation.random(random_state=rng).as_matrix()
    spread = fibonacci_directions(max(config.targets - near, 1)) @ turn.T
    for number in range(config.targets):
        away = _between(centres, config, rng) if number < near else spread[number - near]
        distance = float(np.median(np.linalg.norm(centres, axis=1)))
        centre = world_from_crop[:3, 3] + distance * away
        camera = target_camera(centre, world_from_crop[:3, 3], vertices, config.size, uniform(rng, config.margin))
        one = None if camera is None else target_image(renderer, camera, distance)
        if camera is None or one is None:
            return None
        found.append({**one, "K": camera.K, "pose": np.linalg.inv(world_from_crop) @ camera.world_from_cam})
    return {
        "target_rgb": np.stack([one["rgb"] for one in found]),
        "target_mask": np.stack([one["mask"] for one in found]),
        "target_relief": np.stack([one["relief"] for one in found]),
        "target_K": np.stack([one["K"] for one in found]).astype(np.float32),
        "target_world_from_cam": np.stack([one["pose"] for one in found]).astype(np.float32),
    }


def _between(
    centres: Float64[np.ndarray, "camera 3"], config: ViewsConfig, rng: np.random.Generator
) -> Float64[np.ndarray, "3"]:
    """Unit, from the object: between two of the cameras and a little off."""
    directions = centres / np.linalg.norm(centres, axis=1, keepdims=True)
    first, second = directions[rng.integers(len(directions), size=2)]
    share, off = rng.uniform(), np.tan(np.deg2rad(rng.uniform(0.0, config.apart_deg)))
    middle = first + share * (second - first)
    # Two cameras on opposite sides have no direction between them.
    middle = first if np.linalg.norm(middle) < 0.2 else middle / np.linalg.norm(middle)
    aside = np.cross(middle, rng.normal(size=3))
    aimed = middle + off * aside / max(float(np.linalg.norm(aside)), 1e-9)
    return aimed / np.linalg.norm(aimed)


def target_camera(
    centre: Float64[np.ndarray, "3"],
    origin: Float64[np.ndarray, "3"],
    vertices: Float64[np.ndarray, "vertex 3"],
    size: int,
    margin: float,
) -> CaptureCamera | None:
    """A camera that looks at the crop frame's origin, its window `margin` times as wide as what it must hold.

    None where a vertex is not before it.
    """
    inside = points_in_camera(vertices, aimed_camera(0, centre, origin, focal=1.0, size=(size, size)))
    if inside[:, 2].min() < _NEAREST:
        return None
    reach = float(np.abs(inside[:, :2] / inside[:, 2:]).max())
    return aimed_camera(0, centre, origin, focal=size / 2 / (reach * margin), size=(size, size))


def target_image(renderer: WindowRenderer, camera: CaptureCamera, distance: float) -> dict[str, np.ndarray] | None:
    """The object alone: sRGB times coverage, coverage, and depth less `distance`; None where it is unseen."""
    layers = renderer.layers(camera)
    if layers is None or not layers.coverage.any():
        return None
    x0, y0, x1, y1 = layers.window
    rgb = np.zeros((camera.height, camera.width, 3), np.uint8)
    mask, relief = np.zeros(rgb.shape[:2], np.uint8), np.zeros(rgb.shape[:2], np.float16)
    colour = srgb_from_linear(np.clip(layers.colour, 0.0, 1.0)) * layers.coverage[..., None]
    rgb[y0:y1, x0:x1], mask[y0:y1, x0:x1] = _bytes(colour), _bytes(layers.coverage)
    relief[y0:y1, x0:x1] = np.where(layers.coverage > 0, layers.depth - distance, 0.0)
    return {"rgb": rgb, "mask": mask, "relief": relief}
