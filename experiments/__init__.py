"""One file, one act: `python -m experiments.<verb_object>`."""

import sys

if sys.argv[:1] == ["-m"]:  # an act is about to be loaded, which takes seconds: help and mistakes need not wait
    from experiments._launch.front import before_loading

    before_loading()
