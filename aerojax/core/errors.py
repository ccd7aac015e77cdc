"""The one exception for mistakes that a user can mend."""

from __future__ import annotations

from typing import Literal

Code = Literal[
    "missing",
    "unreadable",
    "invalid",
    "mismatch",
    "out-of-range",
    "occupied",
    "unavailable",
    "unwritable",
    "no-usable-frames",
    "object-absent",
]
"""What kind of mistake it is, for code that reacts to it:

missing: a file, field or thing that is asked for is not there.
unreadable: a file is damaged, cut short or of another format.
invalid: a file or value that contradicts itself or the format's rules.
mismatch: two things that do not fit each other.
out-of-range: a value of the configuration that cannot be used.
occupied: the place for an output holds something else already.
unavailable: an optional package or a device is not there.
unwritable: a disk is full, or a place takes no files.
no-usable-frames: no frame of a capture shows its object to enough cameras.
object-absent: the object to follow is in no mask.
"""


class UserError(ValueError):
    """Bad input or configuration; shown as one message, without a traceback.

    code: the kind of mistake; react to it, never to the words.
    problem: what is wrong; names the field and the file.
    remedy: what the user can do about it; may be empty where the problem says it.
    """

    def __init__(self, code: Code, problem: str, remedy: str = ""):
        # Names from damaged files may hold half letters, which no screen can write.
        problem = problem.encode("utf-8", "backslashreplace").decode()
        super().__init__(code, problem, remedy)
        self.code: Code = code
        self.problem, self.remedy = problem, remedy

    def __str__(self) -> str:
        return f"{self.problem}; {self.remedy}" if self.remedy else self.problem


def failure(error: UserError | OSError) -> dict[str, str]:
    """Why one of many has no result, for the record of a run."""
    return {"code": error.code if isinstance(error, UserError) else "unreadable", "text": str(error)}
