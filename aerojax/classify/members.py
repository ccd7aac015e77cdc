"""The classifiers that there are, by name."""

from __future__ import annotations

from aerojax.classify.base import ClassifierConfig
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.views.config import ViewsConfig

MEMBERS: dict[str, type[ClassifierConfig]] = {"mambasplat": MambaSplatConfig, "views": ViewsConfig}
