"""Irregular loops as NVIDIA Warp kernels, each beside a plain reference."""
