"""What a stage draws and where: purposes, visibility, native instances and point instancers as UsdGeom has them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from pxr import Gf, Usd, UsdGeom

from aerojax.core.errors import UserError
from aerojax.simulate.usd.gprims import SHAPES
from aerojax.simulate.usd.opening import INSTANCES_TOO

EARLIEST = Usd.TimeCode.EarliestTime()
MOST_COPIES = 65_535
"""Meshes and their copies in one stage: what a part's number (16 bits) can count."""
_PROTOTYPES = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
"""Prototypes may be `over` or `class`, so that they are not drawn where they stand."""
_DRAWN_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
_UNREAD_SURFACES = (UsdGeom.NurbsPatch, UsdGeom.TetMesh)

Frame = Callable[[Usd.Prim, float], Gf.Matrix4d]
"""`stage_from_prim` at a time code, acting on row vectors."""


@dataclass(frozen=True)
class Placement:
    """One mesh or shape where it is drawn.

    name: the prim's path; of a copy the instancer's path, its number and the path below the prototype.
    frame: of this prim and of others of the same copy (its skeleton).
    moves: whether `frame` may change over time.
    hidden: whether it is out of sight at a time code; None where it never is.
    """

    prim: Usd.Prim
    name: str
    frame: Frame
    moves: bool
    hidden: Callable[[float], bool] | None


@dataclass(frozen=True)
class _State:
    """What a prim inherits: of the copy that it belongs to, and of its ancestors within it."""

    frame: Frame
    prefix: str
    cut: int
    predicate: object
    purpose: str
    moves: bool = False
    hiders: tuple[Callable[[float], bool], ...] = ()
    hider_times: tuple[float, ...] = ()
    depth: int = 0

    def name(self, prim: Usd.Prim) -> str:
        return self.prefix + str(prim.GetPath())[self.cut :]


def drawn(stage: Usd.Stage) -> list[Placement]:
    """Everything that a renderer draws, in the stage's order; purposes guide and proxy are for other eyes.

    Curves and points have no surface and are left out.

    Raises:
        UserError: an instancer contradicts itself, there are more than `MOST_COPIES` copies, or a surface is of a kind
            that is not read; messages name the prim, not the file.
    """

    def frame(prim: Usd.Prim, time: float) -> Gf.Matrix4d:
        return UsdGeom.Imageable(prim).ComputeLocalToWorldTransform(time)

    found: list[Placement] = []
    visited = 0
    stack = [(stage.GetPseudoRoot(), _State(frame, "", 0, INSTANCES_TOO, UsdGeom.Tokens.default_))]
    while stack:
        prim, given = stack.pop()
        state = _inherited(prim, given)
        if state is None:
            continue
        if prim.IsA(UsdGeom.PointInstancer):
            below = list(_copies(prim, state)) if state.purpose in _DRAWN_PURPOSES else []
        else:
            below = [(child, state) for child in prim.GetFilteredChildren(state.predicate)]
            if (prim.IsA(UsdGeom.Mesh) or any(prim.IsA(s) for s in SHAPES)) and state.purpose in _DRAWN_PURPOSES:
                found.append(Placement(prim, state.name(prim), state.frame, state.moves, _hidden(state)))
            elif any(prim.IsA(s) for s in _UNREAD_SURFACES) and state.purpose in _DRAWN_PURPOSES:
                raise UserError(
                    "invalid", f"{prim.GetPath()}: is a {prim.GetTypeName()}, which is not read", "convert it to a mesh"
                )
        visited += len(below) if prim.IsA(UsdGeom.PointInstancer) else 0
        if len(found) > MOST_COPIES or visited > MOST_COPIES:
            raise UserError(
                "out-of-range",
                f"{prim.GetPath()}: the stage draws more than {MOST_COPIES} meshes and copies",
                "merge them into fewer meshes",
            )
        stack.extend(reversed(below))
    return found


def _inherited(prim: Usd.Prim, given: _State) -> _State | None:
    """The state below a prim; None where nothing of it is ever seen."""
    if not prim.IsA(UsdGeom.Imageable):
        return given
    imageable, state = UsdGeom.Imageable(prim), given
    if imageable.GetPurposeAttr().HasAuthoredValue():
        state = replace(state, purpose=imageable.GetPurposeAttr().Get() or UsdGeom.Tokens.default_)
    if prim.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
        state = replace(state, moves=True)
    visibility = imageable.GetVisibilityAttr()
    if visibility.ValueMightBeTimeVarying():
        times = (*state.hider_times, *visibility.GetTimeSamples())
        hiders = (*state.hiders, lambda time: visibility.Get(time) == UsdGeom.Tokens.invisible)
        if all(any(hides(time) for hides in hiders) for time in times):
            return None
        return replace(state, hiders=hiders, hider_times=times)
    return None if visibility.Get(EARLIEST) == UsdGeom.Tokens.invisible else state


def _hidden(state: _State) -> Callable[[float], bool] | None:
    return (lambda time: any(hides(time) for hides in state.hiders)) if state.hiders else None


def _copies(prim: Usd.Prim, state: _State) -> Iterator[tuple[Usd.Prim, _State]]:
    """Each prototype of an instancer with the state of one copy of it."""
    if state.depth >= 8:
        raise UserError("invalid", f"{prim.GetPath()}: instancers lie within each other without end", "untie them")
    instancer = UsdGeom.PointInstancer(prim)
    roots = _prototypes(instancer)
    numbers = _numbers(instancer, len(roots))
    placed, masks = _Placed(instancer, len(numbers)), _Masks(instancer, len(numbers))
    for i, number in enumerate(numbers):
        hiders, times = state.hiders, state.hider_times
        if masks.varies:
            hiders = (*hiders, lambda time, i=i: masks.hides(i, time))
            times = (*times, *masks.times)
            if all(masks.hides(i, time) for time in masks.times):
                continue
        elif masks.hides(i, EARLIEST):
            continue
        root = roots[number]
        above = root.GetParent()
        yield (
            root,
            _State(
                frame=_copy_frame(state, instancer.GetPrim(), above, placed, i),
                prefix=f"{state.name(prim)}[{i}]",
                cut=0 if above.IsPseudoRoot() else len(str(above.GetPath())),
                predicate=_PROTOTYPES,
                purpose=state.purpose,
                moves=state.moves or placed.moves,
                hiders=hiders,
                hider_times=times,
                depth=state.depth + 1,
            ),
        )


def _prototypes(instancer: UsdGeom.PointInstancer) -> list[Usd.Prim]:
    prim = instancer.GetPrim()
    roots = [prim.GetStage().GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetForwardedTargets()]
    for path, root in zip(instancer.GetPrototypesRel().GetForwardedTargets(), roots, strict=True):
        if not root:
            raise UserError("missing", f"{prim.GetPath()}: its prototype {path} is not there", "correct `prototypes`")
    return roots


def _numbers(instancer: UsdGeom.PointInstancer, prototypes: int) -> list[int]:
    """The prototype of each copy."""
    attribute, path = instancer.GetProtoIndicesAttr(), instancer.GetPath()
    given = attribute.Get(EARLIEST)
    if given is not None and len(given) > MOST_COPIES:
        raise UserError(
            "out-of-range", f"{path}: has {len(given)} copies, more than {MOST_COPIES}", "merge or thin them"
        )
    numbers = list(given or [])
    if any(list(attribute.Get(time) or []) != numbers for time in attribute.GetTimeSamples()):
        raise UserError(
            "invalid", f"{path}: protoIndices change over time, which is not read", "keep copies and hide them instead"
        )
    if wrong := [n for n in numbers if not 0 <= n < prototypes]:
        raise UserError("invalid", f"{path}: protoIndices names {wrong[0]} of {prototypes} prototypes", "correct it")
    return numbers


class _Placed:
    """Transforms of an instancer's copies at the time that was asked for last: each copy asks for the same one."""

    def __init__(self, instancer: UsdGeom.PointInstancer, count: int):
        self._instancer, self._count = instancer, count
        self._time: float | None = None
        self._matrices: Sequence[Gf.Matrix4d] = ()
        attributes = (
            instancer.GetPositionsAttr(),
            instancer.GetOrientationsAttr(),
            instancer.GetScalesAttr(),
            instancer.GetVelocitiesAttr(),
            instancer.GetAngularVelocitiesAttr(),
        )
        self.moves = any(a.ValueMightBeTimeVarying() for a in attributes) or any(
            a.HasAuthoredValue() for a in attributes[3:]
        )

    def at(self, i: int, time: float) -> Gf.Matrix4d:
        if time != self._time:
            ask = self._instancer.ComputeInstanceTransformsAtTime
            kind = UsdGeom.PointInstancer
            matrices = ask(time, time, kind.ExcludeProtoXform, kind.IgnoreMask) if self._count else []
            if len(matrices) != self._count:
                raise UserError(
                    "invalid",
                    f"{self._instancer.GetPath()}: positions, orientations or scales are not as many as its"
                    f" {self._count} protoIndices",
                    "give one of each a copy",
                )
            self._matrices, self._time = matrices, time
        return self._matrices[i]


class _Masks:
    """Which copies `invisibleIds` and `inactiveIds` hide."""

    def __init__(self, instancer: UsdGeom.PointInstancer, count: int):
        self._instancer, self._count = instancer, count
        attribute = instancer.GetInvisibleIdsAttr()
        self.varies, self.times = attribute.ValueMightBeTimeVarying(), tuple(attribute.GetTimeSamples())
        self._memory: dict[float, list[bool]] = {}

    def hides(self, i: int, time: Usd.TimeCode | float) -> bool:
        """Masks change at samples only, so that few are kept."""
        key = time if isinstance(time, float) else float("-inf")
        if key not in self._memory:
            if len(self._memory) > 8:
                self._memory.clear()
            self._memory[key] = list(self._instancer.ComputeMaskAtTime(time))
        mask = self._memory[key]
        return bool(mask) and not mask[i]


def _copy_frame(state: _State, instancer: Usd.Prim, above: Usd.Prim, placed: _Placed, i: int) -> Frame:
    def frame(prim: Usd.Prim, time: float) -> Gf.Matrix4d:
        within, _ = UsdGeom.XformCache(time).ComputeRelativeTransform(prim, above)
        return within * placed.at(i, time) * state.frame(instancer, time)

    return frame
