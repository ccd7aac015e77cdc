"""Whether an answer may be believed: enough frames, cameras that agree, a known kind, a probability; else why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float, Float64

from aerojax.capture.format import CaptureCamera
from aerojax.reconstruct.consistency import Consistency
from aerojax.reconstruct.disagreement import Disagreement, Suspect, slope, suspect

_REMEMBERED = 5
"""Places from which the velocity is taken, no older than `_RECENT_S` seconds."""
_RECENT_S = 0.5

Status = Literal["ok", "unsure", "insufficient"]
"""ok: the label is the answer. unsure: it is the likeliest, no more. insufficient: too little was seen to say that."""
ReasonCode = Literal[
    "few-frames",
    "frames-dropped",
    "too-small",
    "one-camera",
    "few-views",
    "cameras-disagree",
    "low-probability",
    "unfamiliar",
]
"""Why an answer is not the likeliest class: the first three make it insufficient, the last unknown, others unsure."""


@dataclass(frozen=True)
class TrustConfig:
    """From when on an answer is believed.

    Measured on 71 clips of 8 frames of held-out individuals from the factory: 3 to 6 cameras at 3 to 60 m, objects of
    20 to 160 pixels. With turns of 0.1°, clocks of 5 ms and 5 mm, no clip is called inconsistent of the 48 where 0.1°
    is less than 4 % of the object's size, and 8 of all. One camera that is wrong besides, by 0.5° to 2°, 0.1 to 0.3 m
    or 1 to 3 frames, is noticed in every clip if it displaces the object by more than 30 % of its size, in 91 % at 20
    to 30 %, in 66 % at 10 to 20 %. Of what is noticed, a camera is named in 80 %, in 97 % of these the right one; half
    of the offsets are told to 10 %.

    least_frames: usable ones.
    least_share: usable frames, of those in which a camera shows the object.
    least_width_px: pixels that the longer side of the object's box spans where one camera alone shows it, mean over the
        frames. Of six narrower validation clips of the factory as one camera shows them none was right, with a
        probability of 0.8 on average; networks are trained on objects of 12 pixels and more.
    least_views: cameras that show the whole object, mean over the usable frames: two always agree.
    most_disagreement: `Disagreement.level` of cameras that agree.
    most_offset: by which the one camera that is most likely wrong displaces the object, shares of its size.
    least_probability: of the likeliest class; below it the label is wrong more often than right.
    least_familiarity: share of known objects that look as strange to the classifier, below which an object is called
        unknown; so it is also the share of known objects that are called unknown, as far as they are like those of the
        validation families (`measure_unknown` says how far that holds). 0 calls nothing unknown.
    """

    least_frames: int = 3
    least_share: float = 0.5
    least_width_px: float = 8.0
    least_views: float = 2.5
    most_disagreement: float = 1.3
    most_offset: float = 0.12
    least_probability: float = 0.5
    least_familiarity: float = 0.05


@dataclass(frozen=True, eq=False)
class Record:
    """What is remembered of one object to judge the answer by; its size does not grow.

    used, unusable: frames, the second of those in which a camera shows the object.
    one_camera: those of the unusable ones that are answered from one camera; 0 once several have shown the object.
    width_px: sum over those of the longer side of the object's box, pixels.
    sums: of the cameras' disagreement.
    path: last moments and places, seconds and metres, rig's frame, seen by the same cameras.
    watching: these cameras.
    """

    used: int
    unusable: int
    sums: Disagreement
    path: tuple[tuple[float, Float64[np.ndarray, "3"]], ...] = ()
    watching: tuple[bool, ...] = ()
    one_camera: int = 0
    width_px: float = 0.0

    @staticmethod
    def none(cameras: int) -> Record:
        """Nothing seen yet."""
        return Record(0, 0, Disagreement.none(cameras))

    def unused(self) -> Record:
        """One more frame that says nothing but that it could not be used."""
        return replace(self, unusable=self.unusable + 1)

    def by_one_camera(self, width_px: float) -> Record:
        """One more frame in which one camera alone shows the object, none of several before it, and how wide."""
        return replace(self.unused(), one_camera=self.one_camera + 1, width_px=self.width_px + width_px)

    def seen(self, one: Consistency, time_s: float, place: Float64[np.ndarray, "3"], *, used: bool) -> Record:
        """One more frame with its figures; `used` says whether the silhouettes meet."""
        # A camera that is wrong displaces the place: it jumps when the camera comes or goes, and that is no velocity.
        watching = tuple(one.lines.valid.tolist())
        before = self.path if watching == self.watching else ()
        recent = tuple(entry for entry in before if time_s - entry[0] <= _RECENT_S)
        path = (*recent, (time_s, place))[-_REMEMBERED:]
        velocity = slope([moment for moment, _ in path], [where for _, where in path])
        sums = self.sums + Disagreement.of(one, velocity)
        return Record(self.used + used, self.unusable + (not used), sums, path, watching)

    def __add__(self, later: Record) -> Record:
        """Of an object that was lost in between."""
        used, unusable = self.used + later.used, self.unusable + later.unusable
        sums = self.sums + later.sums
        placed = sums.frames > 0
        alone = 0 if placed else self.one_camera + later.one_camera
        width_px = 0.0 if placed else self.width_px + later.width_px
        return replace(later, used=used, unusable=unusable, sums=sums, one_camera=alone, width_px=width_px)


@dataclass(frozen=True)
class Reason:
    """One thing that speaks against an answer."""

    code: ReasonCode
    text: str


@dataclass(frozen=True)
class Verdict:
    """Whether an answer may be believed.

    reasons: none where the likeliest class is the answer.
    disagreement: `Disagreement.level`. suspect: the camera that is wrong, where one can be told.
    unknown: whether the object is like none of the classes; that is the answer where the status is ok.
    familiarity: see `TrustConfig`; None where it is not known.
    """

    status: Status
    reasons: tuple[Reason, ...]
    disagreement: float
    suspect: Suspect | None = None
    unknown: bool = False
    familiarity: float | None = None


def judge(
    record: Record,
    cameras: Sequence[CaptureCamera],
    log_probabilities: Float[np.ndarray, "label"] | None,
    trust: TrustConfig,
    *,
    fps: float | None = None,
    familiarity: float | None = None,
) -> Verdict:
    """The verdict on what is known so far, of a stream or of a whole clip.

    What is unknown needs no probable class, but frames and cameras as any other answer does.

    Args:
        record: of the object.
        cameras: of the network, for their names.
        log_probabilities: calibrated ones, of the last frame; None without a classifier.
        trust: levels.
        fps: says lateness in frames, too.
        familiarity: after the last frame, `Updated.familiarity`; None calls nothing unknown.
    """
    reasons = [*_too_little(record, trust), *_one_camera(record, trust), *_too_few_views(record, trust)]
    sums, guess = record.sums, suspect(record.sums)
    displaced = guess is not None and guess.offset_m > trust.most_offset * sums.mean_size
    if inconsistent := sums.level > trust.most_disagreement or displaced:
        reasons.append(Reason("cameras-disagree", _disagreement_text(sums, guess, cameras, fps)))
    unknown = familiarity is not None and familiarity < trust.least_familiarity
    insufficient = any(reason.code in ("few-frames", "frames-dropped", "too-small") for reason in reasons)
    if unknown:
        text = f"like none of the classes: no more than {familiarity:.1%} of known objects look as strange"
        reasons.append(Reason("unfamiliar", text))
    elif (
        log_probabilities is not None and (surest := float(np.exp(np.max(log_probabilities)))) < trust.least_probability
    ):
        text = f"the likeliest class has a probability of {surest:.2f}, less than {trust.least_probability:g}"
        reasons.append(Reason("low-probability", text))
    doubts = [reason for reason in reasons if reason.code != "unfamiliar"]
    status: Status = "insufficient" if insufficient else "unsure" if doubts else "ok"
    suspected = guess if inconsistent else None
    return Verdict(status, tuple(reasons), sums.level, suspected, unknown, familiarity)


def _too_little(record: Record, trust: TrustConfig) -> list[Reason]:
    shown, used = record.used + record.unusable, record.used or record.one_camera
    if used < trust.least_frames:
        return [Reason("few-frames", f"{used} usable frame(s), {trust.least_frames} are needed")]
    if used < trust.least_share * shown:
        text = f"only {used} of the {shown} frames that show the object could be used"
        return [Reason("frames-dropped", text)]
    return []


def _one_camera(record: Record, trust: TrustConfig) -> list[Reason]:
    if not record.one_camera:
        return []
    width_px = record.width_px / record.one_camera
    text = f"only one camera shows the whole object, in {record.one_camera} frame(s): no place, and none contradicts it"
    reasons = [Reason("one-camera", text)]
    if width_px < trust.least_width_px:
        small = f"it is {width_px:.1f} pixels wide there, {trust.least_width_px:g} are needed"
        reasons.insert(0, Reason("too-small", small))
    return reasons


def _too_few_views(record: Record, trust: TrustConfig) -> list[Reason]:
    views = record.sums.views
    if views is None or views >= trust.least_views:
        return []
    text = f"{views:.1f} cameras a frame show the whole object; only three or more can contradict each other"
    return [Reason("few-views", text)]


def _disagreement_text(
    sums: Disagreement, guess: Suspect | None, cameras: Sequence[CaptureCamera], fps: float | None
) -> str:
    if guess is None:
        most = _most(sums, cameras)
        return f"the cameras disagree about where the object is{most}, and it cannot be told which of them is wrong"
    turned = f"turned by about {guess.turn_deg:.1f}° (or {guess.offset_m:.2g} m out of place)"
    in_frames = "" if fps is None else f", {abs(guess.late_s) * fps:.1f} frames,"
    clock = f"clock is about {1e3 * abs(guess.late_s):.0f} ms{in_frames} {'late' if guess.late_s > 0 else 'early'}"
    why = {"turn": f"it is {turned}", "clock": f"its {clock}", "either": f"its {clock}, or it is {turned}"}
    name, off = cameras[guess.camera].name, f"{guess.offset_m:.2g} m at the object, {guess.offset_px:.1f} pixels"
    return f"camera {name} disagrees with the others by {off}; most likely {why[guess.cause]}"


def _most(sums: Disagreement, cameras: Sequence[CaptureCamera]) -> str:
    shift = sums.mean_shift
    if not np.isfinite(shift).any():
        return ""
    camera = int(np.nanargmax(shift))
    pixels = shift[camera] / sums.mean_pixel[camera]
    return f", {cameras[camera].name} most ({shift[camera]:.2g} m, {pixels:.1f} pixels)"
