"""Open a USD stage as it was meant: nothing that it names is missing, its units and its time are known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Gf, Pcp, Tf, Usd, UsdGeom

from aerojax.core.errors import UserError
from aerojax.core.usd_copies import usd_copy

INSTANCES_TOO = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
"""Prims that are drawn where they stand, those of native instances among them."""
_BROKEN_ARCS = {
    kind.__name__
    for kind in (
        Pcp.ErrorInvalidAssetPath,
        Pcp.ErrorInvalidSublayerPath,
        Pcp.ErrorUnresolvedPrimPath,
        Pcp.ErrorInvalidPrimPath,
        Pcp.ErrorArcCycle,
        Pcp.ErrorSublayerCycle,
    )
}


@contextmanager
def usd_refusals(file: str) -> Iterator[None]:
    """Say in words what USD raises where a prim's attributes are not of their types or contradict each other.

    Args:
        file: what messages call it.

    Raises:
        UserError: USD, or what reads its values, refuses.
    """
    try:
        yield
    except UserError:
        raise
    except (Tf.ErrorException, TypeError, ValueError, IndexError, OverflowError) as error:
        words = str(error).strip().splitlines()
        reason = words[-1].strip() if words else type(error).__name__
        raise UserError("invalid", f"{file}: is not as USD's schemas say ({reason})", "export it again") from error


def open_complete(path: Path) -> Usd.Stage:
    """Open a USD file of our own making with all that it refers to; others are for `foreign_stage`.

    USD itself composes what it finds and leaves out the rest; a model without its wing would pass for a model.

    Raises:
        UserError: the file does not exist or is not readable; a sublayer, reference or payload leads nowhere; its unit
            or its axes are none that USD has.
    """
    _refuse_missing(path)
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise UserError("unreadable", f"asset {path} is not a readable USD file", "export it again") from error
    _refuse_broken([(type(error).__name__, str(error)) for error in stage.GetCompositionErrors()], path)
    _refuse_unknown_frame(stage, path)
    return stage


@contextmanager
def foreign_stage(path: Path) -> Iterator[Usd.Stage]:
    """Open a USD file from elsewhere: a flattened copy of it, which lasts as long as the block (see `usd_copy`).

    Raises:
        UserError: as `open_complete`; or the file is damaged so that USD cannot read it, or not in time.
    """
    _refuse_missing(path)
    with usd_copy(path) as copy:
        _refuse_broken(copy.broken, path)
        stage = Usd.Stage.Open(str(copy.path))
        _refuse_unknown_frame(stage, path)
        yield stage


def _refuse_missing(path: Path) -> None:
    if not path.is_file():
        raise UserError("missing", f"asset {path} does not exist", "check the path or build the assets first")


def _refuse_broken(errors: Iterable[tuple[str, str]], path: Path) -> None:
    for kind, words in errors:
        if kind in _BROKEN_ARCS:
            remedy = "put the file where the stage looks for it, or take that sublayer, reference or payload out"
            raise UserError("missing", f"{path}: {words.rstrip('.')}", remedy)


def _refuse_unknown_frame(stage: Usd.Stage, path: Path) -> None:
    metres, up = UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)
    if not 0 < metres < math.inf:
        raise UserError("invalid", f"{path}: metersPerUnit is {metres}", "set it to the metres of one unit")
    if up not in (UsdGeom.Tokens.y, UsdGeom.Tokens.z):
        raise UserError("invalid", f"{path}: upAxis is {up}", "USD has Y and Z; set either")


def body_from_stage(stage: Usd.Stage) -> Gf.Matrix4d:
    """What brings the stage to metres and +Z up, acting on row vectors as USD's matrices do."""
    matrix = Gf.Matrix4d().SetScale(UsdGeom.GetStageMetersPerUnit(stage))
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y:
        matrix *= Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90.0))
    return matrix


def time_span(stage: Usd.Stage, called: str) -> tuple[float, float]:
    """First and last time code: what the stage says, else those of its samples; both 0 where nothing is sampled.

    Args:
        stage: any.
        called: what messages call it.

    Raises:
        UserError: the stage's range or rate is not finite, or the rate not positive.
    """
    layer, rate = stage.GetRootLayer(), stage.GetTimeCodesPerSecond()
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    if not 0 < rate < math.inf:
        raise UserError("invalid", f"{called}: timeCodesPerSecond is {rate}", "set it to the time codes of one second")
    if not stage.HasAuthoredTimeCodeRange():
        times = [
            t
            for prim in stage.Traverse(INSTANCES_TOO)
            for a in prim.GetAuthoredAttributes()
            for t in a.GetTimeSamples()
        ]
        first = first if layer.HasStartTimeCode() else min(times, default=0.0)
        last = last if layer.HasEndTimeCode() else max(times, default=first)
    if not math.isfinite(last - first):
        raise UserError(
            "invalid", f"{called}: startTimeCode is {first}, endTimeCode {last}", "set both to real time codes"
        )
    return first, max(first, last)
