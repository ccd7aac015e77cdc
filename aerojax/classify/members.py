"""The classifiers that there are, by name."""

from __future__ import annotations

from aerojax.classify.base import ClassifierConfig
from aerojax.classify.mambasplat.config import MambaSplatConfig

MEMBERS: dict[str, type[ClassifierConfig]] = {"mambasplat": MambaSplatConfig}
