"""The report's HTML skeleton; style and script stand in modules of their own, everything ends up in one file."""

from __future__ import annotations

import re
from collections.abc import Mapping

from aerojax.view.report.script import SCRIPT
from aerojax.view.report.style import STYLE

# The policy forbids every request: even a text that slipped through unescaped could load or send nothing.
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<title>[[title]]</title>
<style>[[style]]</style>
</head>
<body>
<header class="card head">
<div class="answer"><h1>[[title]]</h1>[[verdict]]<dl class="summary">[[summary]]</dl></div>
<div class="chances">[[bars]]</div>
</header>
<main>
<section class="card player" id="player">
<div class="controls">
<button id="play" type="button" aria-label="play or pause">▶</button>
<input id="slider" type="range" min="0" max="0" value="0" step="1" aria-label="frame">
<output id="now" for="slider"></output>
</div>
<p class="quiet" id="detail"></p>
<div class="stage">
<div class="cameras">[[cameras]]</div>
<div class="clouds">
<figure><canvas id="front"></canvas><figcaption><b>Front</b> x right, z up</figcaption></figure>
<figure><canvas id="top"></canvas><figcaption><b>Top</b> x right, y up</figcaption></figure>
</div>
</div>
<p class="key"><span><i class="swatch outline"></i>mask</span><span><i class="swatch box"></i>box</span>
<span class="quiet">small frame: where the crop lies in the image</span></p>
<noscript><p class="quiet">The player needs JavaScript; the tables and curves do not.</p></noscript>
</section>
<div class="grid">[[plots]]</div>
<div class="grid">
<section class="card"><h2>Latency, ms</h2>[[latency]]</section>
<section class="card"><h2>Frames used and dropped</h2>[[dropped]]</section>
</div>
<footer class="quiet">[[notes]]</footer>
</main>
<script type="application/json" id="data">[[data]]</script>
<script>[[script]]</script>
</body>
</html>
"""


def assemble(parts: Mapping[str, str]) -> str:
    """The page with `parts` in their places, in one pass: a part that contains `[[data]]` stays as it is.

    Raises:
        KeyError: a place has no part.
    """
    everything = {**parts, "style": STYLE, "script": SCRIPT}
    return re.sub(r"\[\[(\w+)\]\]", lambda place: everything[place[1]], _PAGE)
