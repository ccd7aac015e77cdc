"""An animated USD asset as one triangle mesh: skinning and transforms evaluated from the stage at any time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, Int32, UInt8, UInt16
from pxr import Gf, Usd, UsdGeom

from aerojax.core.errors import UserError
from aerojax.simulate.usd.geometry import Geometry, geometry_of
from aerojax.simulate.usd.joints import EvaluateJoints, joint_evaluators
from aerojax.simulate.usd.materials import FaceAppearance, TextureCache, face_appearance
from aerojax.simulate.usd.opening import body_from_stage, open_complete, time_span, usd_refusals
from aerojax.simulate.usd.placements import Placement, drawn
from aerojax.simulate.usd.skinning import Binding, Evaluate, skinned, skinned_by, skinned_prims, transformed

MOST_TRIANGLES = 20_000_000
"""Of one stage: about 2 GB with what the renderer keeps of each."""


@dataclass(frozen=True)
class AnimatedMesh:
    """The triangles of an asset and where their vertices are at any time.

    faces: vertex indices, counter-clockwise seen from outside.
    albedo: sRGB, 0..1; white where a texture gives the colour.
    uv: texture coordinates of the corners, v upwards; zero without a texture.
    texture: index into `textures`, -1 without one.
    textures: sRGB bytes, top row first.
    part: index into `part_names`.
    part_names: paths of the USD prims; of an instancer's copy its path, the copy's number and the path below.
    cycle_seconds: length of the animation; 0 if nothing moves.
    """

    faces: Int[np.ndarray, "face 3"]
    albedo: Float[np.ndarray, "face 3"]
    uv: Float[np.ndarray, "face 3 2"]
    texture: Int32[np.ndarray, "face"]
    textures: tuple[UInt8[np.ndarray, "_ _ 3"], ...]
    part: UInt16[np.ndarray, "face"]
    part_names: tuple[str, ...]
    cycle_seconds: float
    _stage: Usd.Stage | None = field(repr=False)  # prims do not keep their stage alive; None without a file
    _evaluate: tuple[Evaluate, ...] = field(repr=False)
    _joints: tuple[EvaluateJoints, ...] = field(repr=False)
    _time_codes_per_second: float = field(repr=False)
    _first_time_code: float = field(repr=False)
    _called: str = field(default="", repr=False)
    _hidden: tuple[Callable[[float], bool] | None, ...] = field(default=(), repr=False)  # of each part; none if empty

    def vertices_at(self, seconds: float) -> Float[np.ndarray, "vertex 3"]:
        """Vertices in the body frame, metres; the animation repeats after `cycle_seconds`, before and after 0.

        Parts that are invisible then have all their vertices in one place of a visible part: their faces have no area.

        Raises:
            UserError: points, joints or transforms of that moment contradict the mesh or are not finite.
        """
        time = self._time_code(seconds)
        with usd_refusals(self._called), _naming(self._called):
            posed = [evaluate(time) for evaluate in self._evaluate]
        gone = [hidden is not None and hidden(time) for hidden in self._hidden]
        if any(gone):
            seen = next((points for points, away in zip(posed, gone, strict=True) if not away), posed[0])
            posed = [np.broadcast_to(seen[:1], p.shape) if g else p for p, g in zip(posed, gone, strict=True)]
        vertices = np.concatenate(posed).astype(np.float32, copy=False)
        if not np.isfinite(vertices).all():
            lost = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
            part = self.part[np.isin(self.faces, lost).any(axis=1)]
            name = self.part_names[int(part[0])] if len(part) else "a vertex"
            problem = f"{self._called}: {name}: its points or a transform are not finite at time code {time:g}"
            raise UserError("invalid", problem, "export it again")
        return vertices

    def joints_at(self, seconds: float) -> dict[str, Float[np.ndarray, "4 4"]]:
        """Rigid `body_from_joint` of skeleton joints and animated prims (rotors), metres, by name."""
        time = self._time_code(seconds)
        return {name: pose for joints in self._joints for name, pose in joints(time).items()}

    def _time_code(self, seconds: float) -> float:
        inside = seconds % self.cycle_seconds if self.cycle_seconds > 0 else 0.0
        return self._first_time_code + inside * self._time_codes_per_second


@contextmanager
def _naming(file: str) -> Iterator[None]:
    """Add the file to messages that name a prim."""
    try:
        yield
    except UserError as error:
        raise UserError(error.code, f"{file}: {error.problem}", error.remedy) from error


def load_animated_mesh(path: Path, called: str = "") -> AnimatedMesh:
    """Open a USD file and prepare everything that it draws.

    Read are meshes and UsdGeom's shapes (cubes, spheres, cylinders, cones, capsules, planes), those of native instances
    and point instancers among them; what is invisible or of purpose guide or proxy is left out, as are curves and
    points. Stages in other units or with +Y up are brought to metres and +Z up. Concave polygons are clipped ear by
    ear. Colours come from the bound materials (see `materials`), else from `displayColor` (linear), and are grey where
    both are absent. A stage that does not say when it starts and ends plays all its samples.

    Args:
        path: of the stage.
        called: what messages call it, for a stage that was made from a user's file; its path if empty.

    Raises:
        UserError: if the file does not exist, cannot be opened, names layers, prims or textures that are missing, holds
            nothing to draw, or a prim contradicts itself; the message names the file and the prim.
    """
    called = called or str(path)
    stage = open_complete(path)
    textures = TextureCache()
    with usd_refusals(called):
        first, last = time_span(stage, called)
        joints = joint_evaluators(stage, body_from_stage(stage))
    with usd_refusals(called), _naming(called):
        parts = _parts(stage, first)
        looks = [_appearance(part, textures) for part in parts]
    if not parts:
        raise UserError("missing", f"{called}: the stage holds no visible UsdGeomMesh", "export the object as meshes")
    sizes = np.cumsum([0, *(part.vertices for part in parts[:-1])])
    counts = [len(part.geometry.triangles) for part in parts]
    rate = stage.GetTimeCodesPerSecond()
    return AnimatedMesh(
        faces=np.concatenate([p.geometry.triangles + at for p, at in zip(parts, sizes, strict=True)]).astype(np.int32),
        albedo=np.concatenate([look.albedo for look in looks]).astype(np.float32),
        uv=np.concatenate([look.uv for look in looks]).astype(np.float32),
        texture=np.concatenate([look.texture for look in looks]),
        textures=tuple(textures.pictures),
        part=np.repeat(np.arange(len(parts)), counts).astype(np.uint16),
        part_names=tuple(part.placement.name for part in parts),
        cycle_seconds=(last - first) / rate,
        _stage=stage,
        _evaluate=tuple(part.evaluate for part in parts),
        _hidden=tuple(part.placement.hidden for part in parts),
        _joints=joints,
        _time_codes_per_second=rate,
        _first_time_code=first,
        _called=called,
    )


@dataclass(frozen=True)
class _Part:
    """One drawn prim with what evaluates it."""

    placement: Placement
    geometry: Geometry
    evaluate: Evaluate
    vertices: int


def _parts(stage: Usd.Stage, first: float) -> list[_Part]:
    """Everything that the stage draws, evaluated once so that what contradicts itself is found now."""
    up, bindings = body_from_stage(stage), skinned_prims(stage)
    known: dict[Usd.Prim, Geometry | None] = {}
    found, total = [], 0
    for placement in drawn(stage):
        prim = placement.prim
        if prim not in known:
            known[prim] = geometry_of(prim)
        geometry = known[prim]
        if geometry is None:
            continue
        total += len(geometry.triangles)
        if total > MOST_TRIANGLES:
            raise UserError(
                "out-of-range", f"{placement.name}: the stage draws more than {MOST_TRIANGLES} triangles", "simplify it"
            )
        found.append(_part(placement, geometry, bindings.get(prim.GetPath()), up, first))
    return found


def _part(placement: Placement, geometry: Geometry, binding: Binding | None, up: Gf.Matrix4d, first: float) -> _Part:
    prim, frame = placement.prim, placement.frame
    holder = prim if binding is None else skinned_by(UsdGeom.Mesh(prim), binding)
    if frame(holder, first).ExtractRotationMatrix().GetDeterminant() < 0:
        geometry = geometry.mirrored()  # a mirroring transform turns faces inside out

    if binding is None:
        evaluate = _moving(placement, geometry, up, first)
    else:
        evaluate = skinned(UsdGeom.Mesh(prim), binding, lambda other, time: frame(other, time) * up)
    return _Part(placement, geometry, evaluate, len(evaluate(first)))


def _moving(placement: Placement, geometry: Geometry, up: Gf.Matrix4d, first: float) -> Evaluate:
    """Vertices that only transforms or samples of points move; computed once if nothing does."""
    prim, frame = placement.prim, placement.frame
    if geometry.moves:
        return lambda time: transformed(frame(prim, time) * up, geometry.points_at(time))
    points = geometry.points_at(first)
    if placement.moves:
        return lambda time: transformed(frame(prim, time) * up, points)
    still = transformed(frame(prim, first) * up, points)
    return lambda time: still


def _appearance(part: _Part, textures: TextureCache) -> FaceAppearance:
    geometry, prim = part.geometry, UsdGeom.Gprim(part.placement.prim)
    return face_appearance(prim, geometry.triangles, geometry.corners, geometry.polygon, textures)
