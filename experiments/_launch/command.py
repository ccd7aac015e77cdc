"""How an experiment starts: Hydra composes, a frozen dataclass receives, a run directory remembers.

@experiment(Config)
def main(config: Config, run: Run) -> None: ...

if __name__ == "__main__":
    main()
"""

from __future__ import annotations

import errno
import functools
import importlib
import inspect
import itertools
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import hydra
import jax
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from aerojax.core.claims import claimed, differing
from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.provenance import command_line, provenance
from experiments._launch.arguments import with_keys, with_quotes
from experiments._launch.composition import CONF_DIR, store_defaults
from experiments._launch.front import answer

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = __name__.removesuffix("._launch.command")
"""Where acts are imported from: `experiments`, or where an installed wheel has it."""
RECORD = "run.json"
"""Where a run's directory holds its configuration and origin."""

UNWRITABLE = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTDIR}
"""Errors of the system that are no bugs: a full disk, a quota, a read-only place, a permission, a file for a folder."""

_Config = TypeVar("_Config")


@dataclass(frozen=True)
class Run:
    """Where one run leaves its files, and how it was started."""

    directory: Path
    name: str
    overrides: tuple[str, ...]

    @property
    def command(self) -> str:
        """The command line that started it."""
        return command_line(self.name, self.overrides)

    @property
    def origin(self) -> dict[str, Any]:
        """What a result says of how it was made: command, date, and what is needed to make it again."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        return {"command": self.command, "date": now, **provenance(self.overrides)}


def experiment(
    config_type: type[_Config], *, finished_by: str | None = None, ignoring: tuple[str, ...] = ()
) -> Callable[[Callable[[_Config, Run], None]], Callable[[], None]]:
    """Make `main(config, run)` a command line: `python -m experiments.<name> [key=value …] [-m] [--help]`.

    The configuration is the defaults of `config_type`, changed by `conf/<name>.yaml` and the command line, converted
    once and strictly. A `UserError`, and a disk that is full or may not be written, end the process with code 2 and one
    line; any other exception is a bug and keeps its traceback.

    Args:
        config_type: what `main` takes.
        finished_by: the file that `main` writes last. A run whose directory holds it already is not run again, so a
            sweep that was killed goes on where it stopped; see `is_finished`.
        ignoring: first-level keys that say how a run computes and not what; another value of them is the same run.
    """

    def decorate(act: Callable[[_Config, Run], None]) -> Callable[[], None]:
        name = Path(inspect.getfile(act)).stem

        def job(cfg: DictConfig) -> None:
            try:
                values = OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True)
                config = to_dataclass(values, config_type, source=f"conf/{name}.yaml")  # type: ignore[arg-type]
                settings = HydraConfig.get()
                directory = Path(settings.runtime.output_dir)
                run = Run(directory=directory, name=name, overrides=tuple(settings.overrides.task))
                if finished_by is not None and is_finished(directory, finished_by, values, ignoring):
                    return print(f"{directory} is finished; delete {finished_by} in it to run it again")
                write_json(directory / RECORD, {**provenance(run.overrides), "experiment": name, "config": values})
                act(config, run)
            except (UserError, OmegaConfBaseException, OSError) as error:
                if not _is_told(error) or HydraConfig.get().mode == RunMode.MULTIRUN:
                    raise  # the other runs of a sweep go on
                _refuse(error)  # here, because Hydra announces every exception that reaches it with a line of its own

        @functools.wraps(act)
        def command() -> None:
            if act.__module__ == "__main__":  # a name that other processes, to which launchers send the act, know too
                return importlib.import_module(f"{PACKAGE}.{name}").main()
            os.environ["HYDRA_FULL_ERROR"] = "1"  # exceptions come back here instead of being printed and swallowed
            os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
            keep_compiled_code()
            answer(f"{PACKAGE}.{name}", sys.argv[1:])
            sys.argv[1:] = with_quotes(with_keys(sys.argv[1:], config_type), config_type)
            store_defaults(config_type)
            job.__module__ = f"{PACKAGE}.{name}"  # names the run; this file would otherwise
            entry = hydra.main(version_base="1.3", config_path=str(CONF_DIR), config_name=name)(job)
            try:
                entry()
            except (UserError, HydraException, OmegaConfBaseException, OSError) as error:
                if not _is_told(error):
                    raise
                _refuse(error)
            except KeyboardInterrupt:
                print("interrupted", file=sys.stderr)
                sys.exit(130)

        return command

    return decorate


def claim_folder(wanted: str) -> str:
    """Make the first of `wanted`, `wanted`-2, `wanted`-3, … that is not there: runs of one second have one each."""
    for number in itertools.count(1):
        folder = wanted if number == 1 else f"{wanted}-{number}"
        try:
            Path(folder).mkdir(parents=True)  # of several processes that try, one succeeds
        except FileExistsError:
            continue
        return folder
    raise AssertionError  # the count has no end


OmegaConf.register_new_resolver("claim_folder", claim_folder, use_cache=True, replace=True)


def keep_compiled_code() -> None:
    """Let JAX, in this process and its workers, reuse programs of before (`JAX_COMPILATION_CACHE_DIR` says where)."""
    default = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "aerojax" / "xla"
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(default))
    # Small programs, too: they are so many that without them `classify` took 1.7 times as long when started again.
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
    least = float(os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", least)


def is_finished(directory: Path, result: str, values: Any, ignoring: tuple[str, ...] = ()) -> bool:
    """Whether a run with this configuration has left its last file, `result`, in its directory.

    Raises:
        UserError: a run with another configuration has left files there, which this one would take for its own.
    """
    begun = claimed(directory / RECORD)
    if begun is None:
        return False
    changed = differing(begun["config"], values, ignoring=ignoring)
    if not changed:
        return (directory / result).is_file()
    if any(path.name not in (RECORD, "hydra") for path in directory.iterdir()):
        raise UserError(
            "occupied",
            f"{directory} holds a run with another configuration ({', '.join(changed)} in {RECORD})",
            "delete it, or choose another directory with hydra.run.dir, or hydra.sweep.dir for a sweep",
        )
    return False


def _is_told(error: Exception) -> bool:
    """Whether an exception is for people and no bug."""
    return not isinstance(error, OSError) or error.errno in UNWRITABLE


def _refuse(error: Exception) -> NoReturn:
    if isinstance(error, OSError):
        where = f"{error.filename or error.filename2}: " if error.filename or error.filename2 else ""
        error = UserError(
            "unwritable", f"{where}{error.strerror}", "free space there, or choose a place that takes files"
        )
    print(f"error: {error}", file=sys.stderr)
    sys.exit(2)
