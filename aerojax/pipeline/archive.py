"""Many captures, each classified by itself: an answer a file, so that what is done is done however a run ends."""

from __future__ import annotations

import functools
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import jax
import numpy as np
from jaxtyping import Float32

from aerojax.capture.format import read_capture
from aerojax.classify.base import Classifier
from aerojax.classify.familiarity import Familiarity, load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError, failure
from aerojax.core.files import json_text, write_json, write_text
from aerojax.core.ray_workers import run_on_ray
from aerojax.core.workers import run_surviving
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.pipeline.results import result_of
from aerojax.pipeline.trust import TrustConfig

Cluster = Literal["local", "ray"]
"""Where workers are: processes of this machine, or actors of a Ray cluster."""
Answer = dict[str, Any]
_KEPT = ("status", "reasons", "label", "most_likely", "probabilities", "familiarity", "answer_set", "one_camera")
_DIED = {"error": {"code": "worker-died", "text": "the process that classified it was killed or died, again and again"}}


@dataclass(frozen=True)
class AskedOfCapture:
    """How every capture is classified.

    weights: of a trained classifier; the shipped ones if None.
    trust: from when on an answer is believed.
    """

    seed: int = 0
    weights: Path | None = None
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    trust: TrustConfig = field(default_factory=TrustConfig)


def classify_one(
    folder: Path, asked: AskedOfCapture, classifier: Classifier, familiarity: Familiarity | None
) -> tuple[Answer, Float32[np.ndarray, "label"]]:
    """Truth, answer with its status, probabilities and frames used of one capture; and its log-probabilities.

    Raises:
        UserError: the capture is broken, or none of its frames could be used.
    """
    capture = read_capture(folder)
    truth = capture.true_class(None)
    known = {"trust": asked.trust, "familiarity": familiarity}
    clip = reconstruct_capture(capture, asked.pipeline, classifier, key=jax.random.key(asked.seed), **known)
    assert clip.log_probabilities is not None  # there was a classifier
    result = result_of(capture, clip)
    answer = {name: result[name] for name in _KEPT}
    return {"truth": truth, **answer, "frames": [len(clip.frames), capture.frames]}, clip.log_probabilities[-1]


def classify_archive(
    folders: Mapping[str, Path],
    asked: AskedOfCapture,
    out: Path,
    *,
    workers: int,
    cluster: Cluster,
    progress: Callable[[int, int, str], None],
) -> Counter[str]:
    """Classify captures that have no answer yet and keep each answer in a file of its own, as soon as it is there.

    Answers do not depend on workers, cluster or order. A capture with an error is tried again by the next call.

    Args:
        folders: of the captures, by name; with Ray on several machines all must find them there.
        asked: of each; the same for all answers in `out`.
        out: folder of the answers: answers/<name>.json, and answers.jsonl with one a line in the order of the names.
        workers: processes or actors, each on one core. cluster: where.
        progress: called after each capture with (done, total, what).

    Returns:
        How many have which status, or `error`.
    """
    names = [name for name in sorted(folders) if not _is_answered(_path(out, name))]
    jobs = [(asked, folders[name]) for name in names]
    done = len(folders) - len(names)
    progress(done, len(folders), "captures")
    run = {"local": run_surviving, "ray": run_on_ray}[cluster]
    for place, answer in run(_answered, jobs, workers=workers) if jobs else ():
        write_json(_path(out, names[place]), {"capture": names[place], **(_DIED if answer is None else answer)})
        done += 1
        progress(done, len(folders), "captures")
    counts: Counter[str] = Counter()
    lines = []
    for answer in answers_in(out, sorted(folders)):
        counts["error" if "error" in answer else answer["status"]] += 1
        lines.append(json_text(answer, indent=None).strip())
    write_text(out / "answers.jsonl", "".join(f"{line}\n" for line in lines))
    return counts


def answers_in(out: Path, names: Sequence[str]) -> Iterator[Answer]:
    """Answers of `classify_archive` in the order of the names."""
    for name in names:
        yield json.loads(_path(out, name).read_text(encoding="utf-8"))


def _path(out: Path, name: str) -> Path:
    return out / "answers" / f"{name}.json"


def _is_answered(path: Path) -> bool:
    return path.is_file() and "error" not in json.loads(path.read_text(encoding="utf-8"))


@functools.lru_cache(maxsize=1)
def _loaded(weights: Path | None) -> tuple[Classifier, Familiarity | None]:
    return load_classifier(weights), load_familiarity(weights)


def _answered(job: tuple[AskedOfCapture, Path]) -> Answer:
    """One capture's answer, or why there is none; what is loaded and compiled stays in the process."""
    asked, folder = job
    try:
        return classify_one(folder, asked, *_loaded(asked.weights))[0]
    except (UserError, OSError) as error:
        return {"error": failure(error)}
