"""Rows of observations."""

from __future__ import annotations

import dataclasses

import numpy as np
from support.observed_views import view

from aerojax.evaluate.dataset_qa.observations import joined


def test_rows_are_chosen_in_every_column():
    views = joined([view(), view(frame=1)])
    one = views.where(np.array([False, True]))
    assert {len(getattr(one, f.name)) for f in dataclasses.fields(one)} == {1} and one.frame[0] == 1
