"""Table of planted causes against those found."""

from tests.tools.faults.confusion import confusion, right, table


def test_the_confusion_counts_attributed_causes():
    counts = confusion(["tracking"], range(1))
    assert (counts, right(counts)) == ({("tracking", "tracking"): 1}, 1.0)
    assert table(counts).row_count == 1
