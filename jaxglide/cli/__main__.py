"""`python -m jaxglide.cli`."""

import sys

from . import main

sys.exit(main())
