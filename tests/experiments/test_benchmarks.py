"""What the simulator's benchmark reports: times by step, slopes, sequences chosen, and the comparison of pictures."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from aerojax.core.colour import srgb_from_linear
from aerojax.simulate.render.image import RenderedImage
from experiments._benchmarks import archive, blender, factory, simulator


def test_a_step_inside_another_counts_for_itself_alone():
    now = [0.0]
    watch = simulator.Stopwatch(clock=lambda: now[0])

    def wait(seconds):
        now[0] += seconds

    inner = watch.timed("inner", wait)

    def outer_work():
        wait(1.0)
        inner(2.0)
        inner(4.0)

    watch.timed("outer", outer_work)()
    assert watch.seconds == {"inner": 6.0, "outer": 1.0}
    assert watch.inner == []


def test_slope_is_the_power():
    rows = [{"pixels": float(n), "cpu_s": 3e-6 * n**1.5} for n in (10, 200, 5_000)]
    assert simulator.slope(rows, "pixels") == 1.5


def test_chosen_sequences_spread_over_classes_and_radii():
    config = simulator.dataset_config("sim1", "small")
    tasks = simulator.choose(config, 4)
    assert len({task.identity.label for task in tasks}) == 4
    assert len({task.condition for task in tasks}) == 4


def test_a_sequence_is_recorded_and_its_time_divided(tmp_path):
    config = simulator.replace(simulator.dataset_config("sim2", "smoke"), frames=1)
    job = simulator._Job(simulator.choose(config, 1), config, tmp_path)
    spent = simulator._record(job)
    assert spent.images == 5
    assert set(spent.steps) == {step for step, _, _ in simulator.STEPS} | {"other"}
    assert min(spent.steps.values()) >= 0
    assert sum(spent.steps.values()) == pytest.approx(spent.cpu)
    assert len(list((tmp_path / "0").glob("cam_*/rgb/*.png"))) == 5


def test_steps_are_timed_only_inside():
    before = [getattr(owner, name) for _, owner, name in simulator.STEPS]
    with simulator.stopwatch():
        assert all(getattr(o, n) is not b for (_, o, n), b in zip(simulator.STEPS, before, strict=True))
    assert all(getattr(o, n) is b for (_, o, n), b in zip(simulator.STEPS, before, strict=True))


def test_rates_leave_out_what_a_start_costs():
    found = factory.rates(
        {"clips": 4.0, "seconds": 10.0, "cpu_s": 8.0}, {"clips": 28.0, "seconds": 22.0, "cpu_s": 24.0}
    )
    assert (
        found["clips_per_s"] == 2.0
        and found["clips_per_cpu_s"] == 1.5
        and found["clips_per_s_with_start"] == round(28 / 22, 3)
    )


def test_two_workers_beside_one():
    few, many = ({"captures": n, "seconds": 5.0 + n, "cpu_s": 4.0 + 0.9 * n} for n in (archive.FEW, archive.MANY))
    pair = ({"captures": n, "seconds": 5.0 + 0.6 * n, "cpu_s": 8.0 + n} for n in (archive.FEW, archive.MANY))
    rows = [archive.row(few, many, 1), archive.row(*pair, 2)]
    assert [(r["seconds_a_capture"], r["cpu_s_a_capture"], r["start_cpu_s"]) for r in rows] == [
        (1, 0.9, 4),
        (0.6, 1, 8),
    ]
    assert archive.speed_up(rows) == {"times_faster": 1.67, "times_faster_by_processor_time": 1.8}


def picture() -> RenderedImage:
    """A square of 4×4 whole pixels in a window of 6×6 with a border of half coverage."""
    coverage = np.full((6, 6), 0.5, np.float32)
    coverage[1:5, 1:5] = 1.0
    rgb = np.random.default_rng(0).uniform(0.2, 0.8, (6, 6, 3)).astype(np.float32)
    return RenderedImage(
        width=6,
        height=6,
        window=(0, 0, 6, 6),
        background=np.ones(3, np.float32),
        rgb=rgb,
        mask=(coverage >= 0.25).astype(np.uint16),
        coverage=coverage,
        depth=None,
        normal=None,
        flow=None,
        objects=(),
        rays=0,
    )


def seen_by_cycles(image: RenderedImage) -> np.ndarray:
    """The same picture as Cycles would store it."""
    linear = np.linspace(0, 1, 4097, dtype=np.float32)
    decoded = np.interp(image.rgb, srgb_from_linear(linear), linear).astype(np.float32)
    return np.concatenate([decoded * image.coverage[..., None], image.coverage[..., None]], axis=-1)


def test_equal_pictures_agree_and_others_do_not():
    image = picture()
    theirs = seen_by_cycles(image)
    same = blender.agreement(image, theirs, 0.25)
    assert same["mask_iou"] == 1.0 and same["coverage_difference_at_silhouettes"] == 0.0
    assert same["srgb_difference_mean"] < 1e-3 and same["srgb_correlation"] > 0.9999
    moved = np.roll(theirs, 1, axis=1)
    moved[:, 0] = 0.0
    other = blender.agreement(image, moved, 0.25)
    assert other["mask_iou"] == pytest.approx(30 / 36)
    assert other["coverage_difference_at_silhouettes"] > 0.1
    assert other["srgb_difference_mean"] > 0.05


def test_a_machine_without_blender_says_what_to_install(monkeypatch):
    if importlib.util.find_spec("bpy") is not None:
        pytest.skip("bpy is installed here")
    monkeypatch.delenv("BLENDER_PYTHON", raising=False)
    assert blender.measure() == blender.MISSING
    assert ".[bench]" in blender.MISSING
