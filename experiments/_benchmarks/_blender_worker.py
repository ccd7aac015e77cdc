"""Renders a posed mesh with Blender Cycles on request: a script for a Python that has `bpy`, without aerojax.

    python _blender_worker.py FOLDER THREADS

FOLDER holds `scene.npz`, `texture.png` and `light.json`, written by `blender.export_scene`. Requests are JSON lines on
standard input, answers are lines on standard output that begin with `ANSWER`, because Blender itself writes there too.
"""

from __future__ import annotations

import json
import math
import resource
import sys
import time
from pathlib import Path
from typing import Any

import bpy  # pyrefly: ignore
import numpy as np

ANSWER = "cycles-answer "
_BLENDER_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def build_mesh(scene: Any) -> Any:
    """The triangles, flat, with corner texture coordinates and a linear colour factor a face."""
    mesh = bpy.data.meshes.new("object")
    mesh.from_pydata(scene["vertices"][0].tolist(), [], scene["faces"].tolist())
    uv = mesh.uv_layers.new(name="st")
    uv.data.foreach_set("uv", scene["uv"].astype(np.float32).ravel())
    factor = mesh.color_attributes.new("factor", "FLOAT_COLOR", "CORNER")
    corners = np.ones((len(scene["faces"]) * 3, 4), np.float32)
    corners[:, :3] = np.repeat(scene["albedo"], 3, axis=0)
    factor.data.foreach_set("color", corners.ravel())
    mesh.update()
    thing = bpy.data.objects.new("object", mesh)
    bpy.context.scene.collection.objects.link(thing)
    return mesh


def build_material(picture: Path) -> Any:
    """Lambertian, texture times factor."""
    material = bpy.data.materials.new("diffuse")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    image, factor = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeVertexColor")
    image.image, factor.layer_name = bpy.data.images.load(str(picture)), "factor"
    product = nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    links.new(image.outputs["Color"], product.inputs[0])
    links.new(factor.outputs["Color"], product.inputs[1])
    links.new(product.outputs["Vector"], diffuse.inputs["Color"])
    links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def build_light(light: dict[str, Any]) -> None:
    """A parallel sun, whose π makes its irradiance what `kernels.rays.raytrace.Lighting` means, and two half skies."""
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.energy, lamp.angle = math.pi * light["sun"], 0.0
    sun = bpy.data.objects.new("sun", lamp)
    bpy.context.scene.collection.objects.link(sun)
    from mathutils import Vector  # pyrefly: ignore

    sun.rotation_euler = Vector(light["to_sun"]).to_track_quat("Z", "Y").to_euler()
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    bpy.context.scene.world = world
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    where, parts, upper = (
        nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "MapRange")
    )  # from -ε..ε to ground..sky
    upper.inputs["From Min"].default_value, upper.inputs["From Max"].default_value = -1e-4, 1e-4
    upper.inputs["To Min"].default_value, upper.inputs["To Max"].default_value = light["ground"], light["sky"]
    background, output = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    links.new(where.outputs["Generated"], parts.inputs["Vector"])
    links.new(parts.outputs["Z"], upper.inputs["Value"])
    links.new(upper.outputs["Result"], background.inputs["Strength"])
    links.new(background.outputs["Background"], output.inputs["Surface"])


def build_camera() -> Any:
    """A camera, placed by each request."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width, data.clip_start, data.clip_end = "HORIZONTAL", 36.0, 0.01, 10000.0
    camera = bpy.data.objects.new("camera", data)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    return camera


def settle(scene: Any) -> None:
    """Cycles on the CPU for direct light alone: the settings that make it fastest for this picture."""
    scene.render.engine = "CYCLES"
    cycles, render = scene.cycles, scene.render
    cycles.device, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", False, False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 0
    cycles.transparent_max_bounces = cycles.volume_bounces = 0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.pixel_filter_type = "BOX"
    render.film_transparent = render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = False
    render.threads_mode = "FIXED"
    scene.view_settings.view_transform = "Raw"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.image_settings.color_mode = "RGBA"


def place(scene: Any, camera: Any, view: dict[str, Any]) -> None:
    """Pinhole and border of one request; the border is cropped, so nothing around it costs anything."""
    from mathutils import Matrix  # pyrefly: ignore

    width, height, K = view["width"], view["height"], view["K"]
    camera.matrix_world = Matrix((np.array(view["world_from_cam"]) @ _BLENDER_FROM_OPENCV).tolist())
    camera.data.lens = K[0][0] * 36.0 / width
    camera.data.shift_x, camera.data.shift_y = -(K[0][2] - width / 2) / width, (K[1][2] - height / 2) / width
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    x0, y0, x1, y1 = view["window"]
    render.use_border = render.use_crop_to_border = True
    inside = 0.25  # of a pixel: Blender cuts fractions off, and shares in float32 lie on either side of a whole pixel
    render.border_min_x, render.border_max_x = (x0 + inside) / width, (x1 + inside) / width
    render.border_min_y, render.border_max_y = (height - y1 + inside) / height, (height - y0 + inside) / height


def answer(request: dict[str, Any], folder: Path, stage: tuple[Any, Any, np.ndarray]) -> dict[str, float]:
    """Render every view of one pose; seconds of wall clock and of processor."""
    mesh, camera, vertices = stage
    scene = bpy.context.scene
    scene.cycles.samples = request["samples"]
    wall, usage = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF)
    mesh.vertices.foreach_set("co", vertices[request["pose"]].ravel())
    mesh.update()
    for number, view in enumerate(request["views"]):
        place(scene, camera, view)
        scene.render.filepath = str(folder / f"cycles_{number}.exr")
        bpy.ops.render.render(write_still=request["keep"])
    wall, after = time.perf_counter() - wall, resource.getrusage(resource.RUSAGE_SELF)
    if request["keep"]:
        for number in range(len(request["views"])):
            keep_pixels(folder / f"cycles_{number}.exr")
    return {"wall": wall, "cpu": after.ru_utime + after.ru_stime - usage.ru_utime - usage.ru_stime}


def keep_pixels(path: Path) -> None:
    """An EXR as `.npy`, top row first, linear colour times coverage, and coverage."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    np.save(path.with_suffix(".npy"), pixels.reshape(image.size[1], image.size[0], 4)[::-1])
    bpy.data.images.remove(image)


def main() -> None:
    """Build the scene once, then answer until standard input ends."""
    folder = Path(sys.argv[1])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with np.load(folder / "scene.npz") as file:
        arrays = dict(file)
    mesh = build_mesh(arrays)
    mesh.materials.append(build_material(folder / "texture.png"))
    build_light(json.loads((folder / "light.json").read_text()))
    stage = (mesh, build_camera(), arrays["vertices"].astype(np.float32))
    settle(bpy.context.scene)
    bpy.context.scene.render.threads = int(sys.argv[2])
    print(ANSWER + json.dumps({"blender": bpy.app.version_string}), flush=True)
    for line in sys.stdin:
        print(ANSWER + json.dumps(answer(json.loads(line), folder, stage)), flush=True)


if __name__ == "__main__":
    main()
