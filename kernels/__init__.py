"""Irregular loops as NVIDIA Warp kernels, each beside a plain reference."""

import os as _os

import warp as _warp

_warp.config.log_level = 40  # errors only: banners and module messages belong in no one's results


def _start() -> None:
    """Start Warp without its native warning that a machine without a GPU has no GPU driver."""
    saved, nothing = _os.dup(2), _os.open(_os.devnull, _os.O_WRONLY)
    try:
        _os.dup2(nothing, 2)
        _warp.init()
    finally:
        _os.dup2(saved, 2)
        _os.close(saved)
        _os.close(nothing)


_start()
