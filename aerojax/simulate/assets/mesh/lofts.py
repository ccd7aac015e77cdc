"""Streamlined solids: bodies of superelliptic sections, aerofoil surfaces and rotors.

Aerofoil thickness follows the NACA four-digit distribution (Jacobs, Ward & Pinkerton 1933, NACA report 460); bodies
interpolate a power of their radius so that a nose is round (power 2) or pointed (power 1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.mesh.shapes import Mesh, Vector, loft, merge, moved, rotation_about, tube

Key = tuple[float, float, float, float]
"""Body section: x, half width, half height, height of the centre; metres."""


def smooth(at: Float[np.ndarray, "n"], x: Float[np.ndarray, "k"], y: Float[np.ndarray, "k"]) -> Float[np.ndarray, "n"]:
    """Monotone cubic interpolation with Fritsch-Carlson slopes (1980); x increases, no overshoot between keys."""
    step, secant = np.diff(x), np.diff(y) / np.diff(x)
    slope = np.concatenate([secant[:1], np.zeros(len(x) - 2), secant[-1:]])
    if len(x) > 2:
        product = secant[:-1] * secant[1:]
        total = np.where(product > 0, secant[:-1] + secant[1:], 1.0)
        slope[1:-1] = np.where(product > 0, 2 * product / total, 0.0)
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    t, h = np.clip((at - x[i]) / step[i], 0, 1), step[i]
    hermite = (1 + 2 * t) * (1 - t) ** 2 * y[i] + t * t * (3 - 2 * t) * y[i + 1]
    return hermite + h * t * (1 - t) * ((1 - t) * slope[i] - t * slope[i + 1])


def body(keys: list[Key], exponent: float = 2.0, power: float = 2.0, stations: int = 22, sides: int = 16) -> Mesh:
    """A fuselage along x through `keys`.

    Args:
        keys: sections in any order of x; end sections may be tiny but not zero.
        exponent: superellipse exponent; 2 is an ellipse, 4 a rounded box.
        power: what power of the radius is interpolated; 2 gives round ends, 1 conical ones.
        stations: sections of the mesh, closer together towards both ends.
        sides: points a section (even).
    """
    x, width, height, centre = np.array(sorted(keys), float).T
    share = (1 - np.cos(np.pi * np.linspace(0, 1, stations))) / 2
    at = x[0] + (x[-1] - x[0]) * share
    w, h = (smooth(at, x, r**power).clip(1e-12) ** (1 / power) for r in (width, height))
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    c, s = np.cos(angle), np.sin(angle)
    y = w[:, None] * np.sign(c) * np.abs(c) ** (2 / exponent)
    z = h[:, None] * np.sign(s) * np.abs(s) ** (2 / exponent) + smooth(at, x, centre)[:, None]
    return loft(np.stack([np.broadcast_to(at[:, None], y.shape), y, z], axis=-1))


def aerofoil(points: int, thickness: float, camber: float) -> Float[np.ndarray, "ring 2"]:
    """Outline for unit chord: (aft of the leading edge, up); upper surface from the trailing edge, lower surface back.

    Args:
        points: points on either surface.
        thickness: largest thickness over chord.
        camber: largest camber over chord (parabolic mean line).
    """
    x = (1 + np.cos(np.pi * (np.arange(points) + 0.25) / (points - 0.25))) / 2
    half = 5 * thickness * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.0985 * x**4)
    half = np.maximum(half, 0.06 * thickness)
    line = 4 * camber * x * (1 - x)
    return np.concatenate([np.stack([x, line + half], 1), np.stack([x, line - half], 1)[::-1]])


@dataclass(frozen=True)
class Sections:
    """Aerofoil sections of one surface.

    leading_edge: metres, body frame; chords run aft from here.
    chord: metres.
    up: the unit direction of the upper surface at each section (+z for a wing, ±y for a fin).
    thickness: over chord.
    camber: over chord.
    twist: degrees, nose up positive, about the leading edge.
    """

    leading_edge: Float[np.ndarray, "section 3"]
    chord: Float[np.ndarray, "section"]
    up: Float[np.ndarray, "3"]
    thickness: Float[np.ndarray, "section"]
    camber: float = 0.02
    twist: float | Float[np.ndarray, "section"] = 0.0


def surface(sections: Sections, points: int = 6) -> Mesh:
    """Loft aerofoil sections into a closed surface; `points` an upper or lower side."""
    outline = np.stack([aerofoil(points, float(t), sections.camber) for t in sections.thickness])
    twist = np.deg2rad(np.broadcast_to(np.asarray(sections.twist, float), sections.chord.shape))[:, None]
    aft, up = outline[..., 0] * sections.chord[:, None], outline[..., 1] * sections.chord[:, None]
    aft, up = aft * np.cos(twist) + up * np.sin(twist), up * np.cos(twist) - aft * np.sin(twist)
    backward = np.array([-1.0, 0.0, 0.0])
    return loft(sections.leading_edge[:, None] + aft[..., None] * backward + up[..., None] * sections.up)


def trapezoid(
    root: Vector, tip: Vector, root_chord: float, tip_chord: float, thickness: float = 0.12, camber: float = 0.02
) -> Mesh:
    """A straight-edged wing, tailplane or fin between the leading edges of its root and its tip.

    The upper side faces +z if the surface spans more in y than in z, +y otherwise. The tip is rounded off over the last
    few per cent.
    """
    share = np.array([0.0, 0.33, 0.66, 0.9, 0.97, 1.0])
    shrink = np.array([1.0, 1.0, 1.0, 1.0, 0.93, 0.72])
    start, end = np.asarray(root, float), np.asarray(tip, float)
    full = root_chord + (tip_chord - root_chord) * share
    edge = start + (end - start) * share[:, None]
    edge[:, 0] -= 0.6 * full * (1 - shrink)
    span = end - start
    up = np.array([0.0, -span[2], span[1]]) if abs(span[1]) >= abs(span[2]) else np.array([0.0, span[2], -span[1]])
    up = up / np.linalg.norm(up)
    up = up * np.sign(up[2] if abs(span[1]) >= abs(span[2]) else up[1])
    return surface(Sections(edge, full * shrink, up, thickness * shrink, camber))


def blade(root: float, tip: float, root_chord: float, tip_chord: float, twist: tuple[float, float]) -> Mesh:
    """A rotor blade along +y from radius `root` to `tip`, its leading edge towards +x (clockwise seen from +z).

    The pitch falls from twist[0] to twist[1] degrees; `rotor` mirrors it for the other direction.
    """
    share = np.array([0.0, 0.12, 0.3, 0.6, 0.9, 1.0])
    chord = (root_chord + (tip_chord - root_chord) * share) * np.array([0.55, 0.9, 1.0, 1.0, 1.0, 0.6])
    edge = np.stack([0.3 * chord, root + (tip - root) * share, np.zeros(6)], axis=1)
    angle = twist[0] + (twist[1] - twist[0]) * share
    return surface(Sections(edge, chord, np.array([0.0, 0.0, 1.0]), np.full(6, 0.11), 0.02, angle), points=4)


def fan(
    degrees: Float[np.ndarray, "section"],
    inner: float,
    outer: Float[np.ndarray, "section"],
    thickness: tuple[float, float],
) -> Mesh:
    """A thin closed sheet in the xy-plane, spread about the origin: tails and crests.

    Args:
        degrees: direction of each section, increasing; 0 is backward (-x), positive to the left (+y).
        inner: radius at which every section starts, metres.
        outer: radius at which each section ends, metres; what it leaves out is a notch or a point.
        thickness: at the inner and at the outer end, metres.
    """
    share = np.linspace(0.0, 1.0, 4)
    half = (thickness[0] + (thickness[1] - thickness[0]) * share) / 2
    radius = inner + (outer - inner)[:, None] * np.concatenate([share, share[::-1]])
    angle = np.deg2rad(degrees)[:, None]
    z = np.broadcast_to(np.concatenate([half, -half[::-1]]), radius.shape)
    return loft(np.stack([-radius * np.cos(angle), radius * np.sin(angle), z], axis=-1))


@dataclass(frozen=True)
class RotorShape:
    """A rotor about z through the origin; lengths in metres, pitch in degrees at root and tip."""

    blades: int
    radius: float
    root_chord: float
    tip_chord: float
    pitch: tuple[float, float] = (12.0, 5.0)
    hub_radius: float = 0.01
    hub_height: float = 0.015
    coning: float = 0.0
    clockwise: bool = False


def rotor(shape: RotorShape) -> Mesh:
    """Blades and hub; seen from above the leading edges go counter-clockwise unless `clockwise`."""
    one = blade(0.7 * shape.hub_radius, shape.radius, shape.root_chord, shape.tip_chord, shape.pitch)
    one = moved(one, (0.0, 0.0, 0.0), rotation_about((1.0, 0.0, 0.0), shape.coning))
    if not shape.clockwise:
        one = Mesh(one.points * np.array([-1.0, 1.0, 1.0]), one.faces[:, ::-1].copy())
    turned = [
        moved(one, (0.0, 0.0, 0.0), rotation_about((0.0, 0.0, 1.0), 360.0 * i / shape.blades))
        for i in range(shape.blades)
    ]
    half = shape.hub_height / 2
    return merge(*turned, tube((0.0, 0.0, -half), (0.0, 0.0, half), shape.hub_radius))
