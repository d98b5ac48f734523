"""Tables of counts in the documentation: totals first, words for counts, a colour for each cell."""

import sys
from pathlib import Path

import pytest

core = pytest.importorskip("docutils.core")
sys.path.append(str(Path(__file__).parents[1] / "docs"))
from heat import colour  # noqa: E402

TABLE = """
.. list-table::
   :header-rows: 1

   * - hidden
     - cart
   * - leak
     - 0 / 0 / 1 / 0
   * - all effects
     - 28 / 1 / 0 / 0

.. list-table::

   * - 1 / 2
     - of another kind
"""


def test_totals_come_first_and_cells_say_what_they_count():
    tree = core.publish_doctree(TABLE)
    colour(None, tree)
    heat, other = tree.findall(lambda node: node.tagname == "table")
    assert "heat" in heat["classes"]
    assert "heat" not in other["classes"]
    body = next(iter(heat.findall(lambda node: node.tagname == "tbody")))
    said = {row[0].astext(): (row[1].astext().split("\n\n"), row[1]["classes"]) for row in body}
    assert list(said) == ["all effects", "leak"]
    assert said["all effects"] == (["28 named", "1 absorbed"], ["heat-named"])
    assert said["leak"] == (["missed"], ["heat-missed"])
