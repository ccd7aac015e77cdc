"""The classifier in plain PyTorch from public packages, for a comparison of speed.

    lifting of positions and scaled axes → VN transformer → weighted pool → frame bridge → Mamba layers → head

Needs torch, VN-transformer (and packaging, which it forgets to ask for) and mambapy. The sizes and the number of
parameters are those of the published variant, less its last norm and one map in each rectifier of the bridge; the
operators are the packages' own, so the logits are not ours. It imports nothing of aerojax,
because a Python without JAX may run it.
"""

from __future__ import annotations

from typing import Any

import torch  # pyrefly: ignore
from mambapy.mamba import MambaBlock, MambaConfig  # pyrefly: ignore
from torch import nn  # pyrefly: ignore
from VN_transformer.VN_transformer import (  # pyrefly: ignore
    VNLinear,
    VNTransformerEncoder,
    VNWeightedPool,
)

CHANNELS, WIDTH, LAYERS, CLASSES, SLOTS = 14, 256, 4, 4, 7
SCALARS = SLOTS - 3


class Frame(nn.Module):
    """Three vectors that rotate with the pooled ones (Deng et al. 2021): two leaky rectified layers and a last one."""

    def __init__(self) -> None:
        super().__init__()
        self.maps = nn.ModuleList([VNLinear(2 * CHANNELS, CHANNELS), VNLinear(CHANNELS, CHANNELS)])
        self.directions = nn.ModuleList([VNLinear(CHANNELS, CHANNELS) for _ in range(2)])
        self.last = VNLinear(CHANNELS, 3)

    def forward(self, vectors: Any) -> Any:
        """(frame, channel, 3) → (frame, 3, 3)."""
        x = torch.cat([vectors, vectors.mean(dim=1, keepdim=True).expand_as(vectors)], dim=1)
        for linear, direction in zip(self.maps, self.directions, strict=True):
            x = linear(x)
            k = direction(x)
            inner, square = (x * k).sum(-1, keepdim=True), (k * k).sum(-1, keepdim=True)
            x = torch.where(inner >= 0, x, x - 0.8 * inner / (square + 1e-6) * k)
        return self.last(x)


class Classifier(nn.Module):
    """MambaSplat in mode X; `flash` uses PyTorch's fused attention."""

    def __init__(self, *, flash: bool) -> None:
        super().__init__()
        self.lift = VNLinear(4, CHANNELS, bias_epsilon=1e-6)
        self.encoder = VNTransformerEncoder(
            dim=CHANNELS, depth=4, dim_head=8, heads=4, dim_coor=SLOTS, bias_epsilon=1e-6, flash_attn=flash
        )
        self.pool = VNWeightedPool(CHANNELS)
        self.frame = Frame()
        self.bridge = nn.Sequential(nn.Linear(3 * CHANNELS + SCALARS * CHANNELS, WIDTH), nn.GELU(), nn.LayerNorm(WIDTH))
        self.norms = nn.ModuleList([nn.LayerNorm(WIDTH) for _ in range(LAYERS)])
        self.mixers = nn.ModuleList([MambaBlock(MambaConfig(d_model=WIDTH, n_layers=1)) for _ in range(LAYERS)])
        self.norm = nn.LayerNorm(WIDTH)
        self.dropout = nn.Dropout(0.05)
        self.head = nn.Sequential(
            nn.Linear(WIDTH, WIDTH // 2), nn.ReLU(), nn.Dropout(0.1), nn.Linear(WIDTH // 2, CLASSES)
        )

    def tokens(self, columns: Any) -> Any:
        """(frame, token, 14) → (frame, token, channel, slot): position and scaled axes, then opacity and colour."""
        position = columns[..., :3] - columns[..., :3].mean(dim=1, keepdim=True)
        w, x, y, z = nn.functional.normalize(columns[..., 3:7], dim=-1).unbind(-1)
        rows = (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
        rotation = torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)
        axes = (rotation * columns[..., None, 7:10]).transpose(-1, -2)
        lifted = self.lift(torch.cat([position[..., None, :], axes], dim=-2))
        scalars = columns[..., None, 10:14].expand(*lifted.shape[:-1], SCALARS)
        return torch.cat([lifted, scalars], dim=-1)

    def forward(self, columns: Any, mask: Any) -> Any:
        """(clip, frame, token, 14) and the valid tokens → (clip, class) logits."""
        clips, frames = columns.shape[:2]
        flat, valid = columns.flatten(0, 1), mask.flatten(0, 1)
        pooled = self.pool(self.encoder(self.tokens(flat), mask=valid), mask=valid)
        vectors, scalars = pooled[..., :3], pooled[..., 3:]
        invariants = torch.cat(
            [(vectors @ self.frame(vectors).transpose(-1, -2)).flatten(1), scalars.flatten(1)], dim=1
        )
        hidden = self.bridge(invariants).reshape(clips, frames, WIDTH)
        residual = torch.zeros_like(hidden)
        for norm, mixer in zip(self.norms, self.mixers, strict=True):
            residual = residual + hidden
            hidden = self.dropout(mixer(norm(residual)))
        return self.head(self.norm(hidden + residual).mean(dim=1))


class Engine:
    """A model, an optimiser and inputs of one size; `forward` and `step` do one call each."""

    def __init__(self, *, flash: bool) -> None:
        torch.manual_seed(0)
        self.model = Classifier(flash=flash)
        self.optimiser = torch.optim.AdamW(self.model.parameters(), lr=1e-3, betas=(0.9, 0.95), weight_decay=0.05)
        self.parameters = sum(p.numel() for p in self.model.parameters())
        self.version = torch.__version__

    def load(self, columns: Any) -> None:
        """Take clips (clip, frame, token, 14), all tokens valid, of classes 0, 1, 2, …"""
        self.columns = torch.from_numpy(columns)
        self.mask = torch.ones(columns.shape[:3], dtype=torch.bool)
        self.label = torch.arange(len(columns)) % CLASSES

    def forward(self) -> None:
        """Logits, without dropout and without a graph."""
        self.model.eval()
        with torch.inference_mode():
            self.model(self.columns, self.mask)

    def step(self) -> None:
        """Loss, gradient, clipping, AdamW."""
        self.model.train()
        logits = self.model(self.columns, self.mask)
        loss = nn.functional.cross_entropy(logits, self.label, label_smoothing=0.1)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.optimiser.step()
