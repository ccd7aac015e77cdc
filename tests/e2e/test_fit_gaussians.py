"""`python -m experiments.fit_gaussians preset=smoke`, whole: simulate, fit, measure, export."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from aerojax.gaussians.io.ply import read_ply
from aerojax.gaussians.io.usd_reading import read_usd
from experiments import fit_gaussians


@pytest.mark.long
def test_fit_improves_on_the_hull_and_exports(tmp_path, monkeypatch):
    where = (f"hydra.run.dir={tmp_path}/run", f"sample.folder={tmp_path}/samples", f"assets={tmp_path}/assets")
    monkeypatch.setattr(sys, "argv", ["fit_gaussians.py", "preset=smoke", *where])
    fit_gaussians.main()
    metrics = json.loads((tmp_path / "run/metrics.json").read_text())
    assert metrics["fitting_views"] == 7 and metrics["held_out_views"] == 1
    assert metrics["matte"] == "estimated"  # the sample has masks only
    fitted, hull = (metrics[f"{name}_fitting_views"]["foreground_psnr_db"] for name in ("fitted", "hull"))
    assert fitted > hull
    ply, (usd,) = read_ply(tmp_path / "run/fitted.ply"), read_usd(tmp_path / "run/fitted.usdc")
    np.testing.assert_allclose(ply.mean, usd.mean, atol=1e-5)
    assert len(ply.mean) == metrics["gaussians"]
    assert (tmp_path / "run/fitted_held_out_view.png").stat().st_size > 0
