"""Pages are made of template files that lie in the package: HTML with `[[places]]`, style sheets and scripts."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from importlib.resources import files


def read_template(name: str) -> str:
    """The text of a file below this package, such as `report/page.html`."""
    return files("aerojax.view").joinpath(name).read_text(encoding="utf-8")


def policy_hash(text: str) -> str:
    """By which a page's content security policy lets one script or style of its own through (CSP 3, §6.7.3)."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def fill(template: str, parts: Mapping[str, str]) -> str:
    """A template with `parts` in their places, in one pass: a part that contains `[[data]]` stays as it is.

    Raises:
        KeyError: a place has no part.
    """
    return re.sub(r"\[\[(\w+)\]\]", lambda place: parts[place[1]], template)
