"""`python -m wayproof` is the command `wayproof`."""

import sys

from wayproof.harness.cli.main import main

sys.exit(main())
