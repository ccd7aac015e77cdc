"""Every row of every comparison composes, and rows that are held against others name rows of the same table."""

from __future__ import annotations

import pytest
import yaml
from support.act_configs import config_of, values_of

from aerojax.core.config import to_dataclass
from experiments._launch.composition import CONF_DIR


def rows_of(table: str) -> list[str]:
    """Names of a table's rows."""
    named = yaml.safe_load((CONF_DIR / "rows" / f"{table}.yaml").read_text())
    return [name.strip() for name in named["hydra"]["sweeper"]["params"]["classifier"].split(",")]


@pytest.mark.slow
@pytest.mark.parametrize("table", ["features", "steps", "baselines", "studies", "reconstructors", "images"])
def test_rows_of(table):
    names, kind = rows_of(table), config_of("compare_classifiers")
    assert len(set(names)) == len(names)
    for name in names:
        config = to_dataclass(values_of("compare_classifiers", f"rows={table}", f"classifier={name}"), kind)
        assert (config.rows, config.classifier) == (table, name)
        assert table in ("baselines", "features", "images") or config.against in ("", *names)
