"""`python -m tests.estimates`: see `tests.estimates.campaign`."""

import sys

from tests.estimates.campaign import main

sys.exit(main())
