"""`python -m tests.campaigns.estimates`: see `tests.campaigns.estimates.campaign`."""

import sys

from tests.campaigns.estimates.campaign import main

sys.exit(main())
