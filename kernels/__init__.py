"""Irregular loops as NVIDIA Warp kernels, each beside a plain reference."""

import warp as _warp

_warp.config.quiet = True  # its banner and module messages belong in no one's results
