"""The page of a running service: one file that asks its own server for what is new, and nobody else for anything."""

from __future__ import annotations

from aerojax.view.templates import fill, policy_hash, read_template


def live_page() -> tuple[bytes, dict[str, str]]:
    """The page, and the headers under which it runs its own script and style and no other.

    It holds nothing of the site: names and texts come as JSON and are put on the page as text.
    """
    style, script = read_template("live/style.css"), read_template("live/script.js")
    page = fill(read_template("live/page.html"), {"style": style, "script": script})
    policy = (
        f"default-src 'none'; script-src '{policy_hash(script)}'; style-src '{policy_hash(style)}'; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return page.encode(), {"Content-Security-Policy": policy}
