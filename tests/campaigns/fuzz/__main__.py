"""`python -m tests.campaigns.fuzz`: see `tests.campaigns.fuzz.campaign`."""

import sys

from tests.campaigns.fuzz.campaign import main

sys.exit(main())
