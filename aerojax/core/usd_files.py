"""USD stages on disk: a full disk or a place that takes no files is a `UserError`, and leaves no half of a file."""

from __future__ import annotations

from pathlib import Path

from pxr import Tf, Usd

from aerojax.core.errors import UserError
from aerojax.core.files import whole_file


def create_stage(path: Path) -> Usd.Stage:
    """A new stage that `save_stage` writes to `path`.

    Raises:
        UserError: nothing can be written there.
    """
    try:
        return Usd.Stage.CreateNew(str(path))
    except Tf.ErrorException:
        raise _unwritable(path) from None


def save_stage(stage: Usd.Stage) -> None:
    """Write the stage's root layer to its place; where that fails, no file is left there.

    Raises:
        UserError: it cannot be written, such as on a full disk.
    """
    path = Path(stage.GetRootLayer().realPath)
    try:
        saved = stage.GetRootLayer().Save()
    except Tf.ErrorException:
        saved = False
    if not saved:
        path.unlink(missing_ok=True)  # USD leaves what it could write, under the final name
        raise _unwritable(path) from None


def export_stage(stage: Usd.Stage, path: Path) -> None:
    """Write the stage's root layer to another file, whole or not at all.

    Raises:
        UserError: it cannot be written.
    """
    try:
        with whole_file(path) as temporary:
            if not stage.GetRootLayer().Export(str(temporary)):
                raise _unwritable(path)
    except Tf.ErrorException:
        raise _unwritable(path) from None


def _unwritable(path: Path) -> UserError:
    return UserError("unwritable", f"{path}: cannot be written", "free space there, or choose a place that takes files")
