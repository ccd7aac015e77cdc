"""`python -m aerojax` and the command `aerojax`: the acts by name.

The one module of this package that may import `experiments`; nothing imports it.
"""

from __future__ import annotations

from experiments._launch.console import main

if __name__ == "__main__":
    main()
