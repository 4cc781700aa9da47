"""`python -m clpeel` is the command `clpeel`."""

import sys

from clpeel.command.main import main

sys.exit(main())
