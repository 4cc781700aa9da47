"""`python -m clpeel` is the command `clpeel`."""

import sys

from clpeel.cli import main

sys.exit(main())
