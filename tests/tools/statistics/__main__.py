"""`python -m tests.tools.statistics intervals`: coverage, false alarms, looks, power."""

import argparse
import sys

from rich.console import Console

from tests.tools.statistics.coverage import PARTS
from wayproof.harness.bench.table import print_rows

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("part", choices=PARTS)
parser.add_argument("--repeats", type=int, default=1000)
parser.add_argument("--seed", type=int, default=0)
options = parser.parse_args()
rows = PARTS[options.part](options.repeats, options.seed, lambda text: print(text, file=sys.stderr))
print_rows(Console(), options.part, rows)
