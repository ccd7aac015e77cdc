"""Animated meshes made ready for rays."""

from __future__ import annotations

from typing import Any

from aerojax.core.colour import linear_from_srgb
from aerojax.simulate.render.textures import build_pyramids
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from kernels.rays.raytrace import SceneCaster, Surface


def scene_caster(meshes: tuple[AnimatedMesh, ...], *, static_mesh: Any = None) -> SceneCaster:
    """A ray caster of meshes in the pose of their time 0.

    Args:
        meshes: one an object.
        static_mesh: a Warp mesh in the world frame that hides and shades them; None without one.
    """
    surfaces = tuple(Surface(m.faces, linear_from_srgb(m.albedo), m.uv, m.texture, m.textures) for m in meshes)
    pyramids = build_pyramids(tuple(texture for mesh in meshes for texture in mesh.textures))
    return SceneCaster(surfaces, tuple(m.vertices_at(0.0) for m in meshes), pyramids, static_mesh=static_mesh)
