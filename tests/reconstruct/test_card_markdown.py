"""The page that stands beside a trained reconstructor."""

from __future__ import annotations

import pytest

from aerojax.reconstruct.card_markdown import card_markdown

RECORD = {
    "parameters": 151586,
    "command": "python -m experiments.train_reconstructor reconstruct=refine",
    "seed": 3,
    "commit": "abc",
    "minutes": 51.6,
    "machine": {"cpus": 2},
    "scenes": {"train": 4800, "val": 64, "size": 64, "views": ["data/views_small"]},
    "validation": {"psnr_db": 16.52, "start_psnr_db": 14.53, "surround_psnr_db": 12.7, "ssim": 0.717, "score": 12.7},
}


@pytest.mark.parametrize(("minutes", "spent"), [(51.6, "in 52 minutes"), (None, "in more than one run")])
def test_says_what_made_it_and_how_good_it_is(minutes, spent):
    page = card_markdown("refine", {**RECORD, "minutes": minutes})
    assert page.startswith("# refine\n") and "151,586 parameters" in page and f"{spent} on 2 CPU cores" in page
    assert "`python -m experiments.train_reconstructor reconstruct=refine`\n(seed 3, commit abc)" in page
    assert "| PSNR on the object, dB | 14.53 | 16.52 |" in page
    assert "| SSIM | | 0.72 |" in page, "no figure of the start"
