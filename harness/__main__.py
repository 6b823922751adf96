"""`python -m harness` is the command `wayproof`."""

import sys

from harness.cli import main

sys.exit(main())
