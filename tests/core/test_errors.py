"""Messages to the user can be written to any screen."""

from __future__ import annotations

import pickle

from aerojax.core.errors import UserError, failure


def test_half_letters_of_a_name_are_spelled_out():
    error = UserError("missing", "\ud800.bin is missing", "look for it")
    assert str(error) == "\\ud800.bin is missing; look for it"
    assert str(error).encode()
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_other_letters_stay():
    assert str(UserError("missing", "第一 is missing")) == "第一 is missing"


def test_why_one_of_many_has_no_result():
    assert failure(UserError("missing", "a", "b")) == {"code": "missing", "text": "a; b"}
    assert failure(PermissionError("no")) == {"code": "unreadable", "text": "no"}
