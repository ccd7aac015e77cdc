"""Curves of a run for TensorBoard, written only where they are asked for."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerojax.core.errors import UserError


class ScalarLog:
    """Scalars by name and step in the event files of a folder; a resumed run's curves go on where they were."""

    def __init__(self, folder: Path):
        """Write to `folder`, which is made with the first scalar.

        Raises:
            UserError: the package that writes event files is not installed.
        """
        if importlib.util.find_spec("tensorboardX") is None:
            raise UserError(
                "unavailable",
                "tensorboard=true needs tensorboardX, which comes with the extra `log` (pip install -e '.[log]')",
                "install it or set tensorboard=false",
            )
        self._folder = folder
        self._writer: Any = None

    def write(self, step: int, scalars: Mapping[str, float]) -> None:
        """Add one point to each curve; what a killed process left from the first such step on is hidden."""
        if self._writer is None:
            from tensorboardX import SummaryWriter

            self._writer = SummaryWriter(str(self._folder), purge_step=step)
        for name, value in scalars.items():
            self._writer.add_scalar(name, value, step)

    def close(self) -> None:
        """Write what is still in memory."""
        if self._writer is not None:
            self._writer.close()
