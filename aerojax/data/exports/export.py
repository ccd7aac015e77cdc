"""A data set to one format: sequences in parallel, merged at the end, complete or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from aerojax.capture.format import read_capture
from aerojax.core.claims import claimed, plain
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.files import fingerprint, write_json
from aerojax.data.exports import coco, colmap, mot, nerfstudio, replicator, yolo
from aerojax.data.exports.sources import ExportFormat, ExportOptions, SourceSequence

FORMATS = {
    "coco": ExportFormat(coco.write_sequence, coco.finish),
    "yolo": ExportFormat(yolo.write_sequence, yolo.finish),
    "mot": ExportFormat(mot.write_sequence, mot.finish),
    "colmap": ExportFormat(colmap.write_sequence, colmap.finish),
    "nerfstudio": ExportFormat(nerfstudio.write_sequence, nerfstudio.finish),
    "replicator": ExportFormat(replicator.write_sequence, replicator.finish),
}


def chosen_formats(value: object) -> tuple[str, ...]:
    """One name of a format or a list of them, checked.

    Raises:
        UserError: a name is unknown or stands twice, or there is none.
    """
    names = [value] if isinstance(value, str) else value
    known = ", ".join(FORMATS)
    if not isinstance(names, (list, tuple)) or not names:
        raise UserError("out-of-range", f"format={value!r} names no format", f"choose one or a list of {known}")
    for name in names:
        if not isinstance(name, str) or name not in FORMATS:
            raise UserError("invalid", f"format: unknown format {name!r}", f"known are {known}")
    if len(set(names)) < len(names):
        raise UserError("out-of-range", f"format={value!r} names a format twice", "name each once")
    return tuple(names)


def export_dataset(
    sequences: Sequence[SourceSequence],
    format_name: str,
    out: Path,
    options: ExportOptions,
    *,
    workers: int = 1,
    overwrite: bool = False,
    notices: Sequence[Path] = (),
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Path:
    """Write `out/<format>`; it appears when it is complete, and a failed export leaves nothing behind.

    An export of the same captures with the same options that is there already is left as it is, so that one to several
    formats that was killed goes on where it stopped.

    Args:
        sequences: from `find_sequences`; order and number of workers change nothing in the result.
        format_name: a key of `FORMATS`.
        out: folder for exports; made if it is not there.
        options: choices that all formats share.
        workers: threads; decoding and writing images leave Python's lock.
        overwrite: replace an export of the same format.
        notices: files that go with the data, such as its licence; copied to the top of the export.
        progress: called after each sequence with (done, total, what).

    Raises:
        UserError: there is another export already, or a capture is broken or does not fit the format.
    """
    if workers < 1:
        raise UserError("out-of-range", f"workers={workers} must be at least 1", "correct it")
    target, record = out / format_name, out / f".{format_name}.json"
    made = _made_from(sequences, options, notices)
    if target.exists() and not overwrite:
        if claimed(record) == made:
            progress(len(sequences), len(sequences), format_name)
            return target
        raise UserError(
            "occupied", f"{target}: there is an export already", "choose another `out` or set overwrite=true"
        )
    out.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(dir=out, prefix=f".{format_name}-"))
    temporary.chmod(0o755)
    parts = temporary / ".parts"
    try:
        with ThreadPoolExecutor(workers) as pool:

            def write(sequence: SourceSequence) -> Path:
                return _write_part(sequence, FORMATS[format_name], temporary, parts, options)

            futures = [pool.submit(write, sequence) for sequence in sequences]
            try:
                files = []
                for done, future in enumerate(futures, start=1):
                    files.append(future.result())
                    progress(done, len(futures), format_name)
            except BaseException:
                pool.shutdown(cancel_futures=True)  # the first problem ends the export
                raise
        FORMATS[format_name].finish(temporary, files)
        shutil.rmtree(parts)
        for notice in notices:
            shutil.copyfile(notice, temporary / notice.name)
        record.unlink(missing_ok=True)
        if not target.exists():
            write_json(record, made)
        _publish(temporary, target)
        write_json(record, made)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return target


def _made_from(sequences: Sequence[SourceSequence], options: ExportOptions, notices: Sequence[Path]) -> dict[str, Any]:
    """By what an export is known again: sequences, their captures' descriptions, options and notices."""
    described = (path for one in sequences for path in sorted(one.folder.glob("*.json")))
    content = fingerprint(*(path.read_bytes() for path in (*described, *notices)))
    names = [f"{one.split}/{one.name}" for one in sequences]
    return plain({"sequences": names, "options": to_mapping(options), "content": content})


def find_notices(dataset: Path) -> tuple[Path, ...]:
    """Licence and attribution of a data set, as far as it has them."""
    return tuple(file for name in ("LICENSE", "ATTRIBUTION.md") if (file := dataset / name).is_file())


def _write_part(
    sequence: SourceSequence, writer: ExportFormat, folder: Path, parts: Path, options: ExportOptions
) -> Path:
    part = writer.write_sequence(read_capture(sequence.folder), sequence, folder, options)
    path = parts / sequence.split / f"{sequence.name}.json"
    write_json(path, part, indent=None)
    return path


def _publish(temporary: Path, target: Path) -> None:
    """Rename the finished folder to its place; one that stood there goes once its name is free."""
    if target.exists():
        old = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}-old-"))
        target.replace(old / target.name)
        temporary.replace(target)
        shutil.rmtree(old)
    else:
        temporary.replace(target)
