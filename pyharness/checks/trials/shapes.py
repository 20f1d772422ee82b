"""Trial of extreme shapes: needles, coins, flat plates, and moments that no body can have."""

from pyharness.checks.hold import check_all
from pyharness.checks.stress import Trial

TRIAL = Trial(
    "shapes",
    "moments in the ratio 1 : 1 : 1e-12 and 1 : 1e12 : 1e12, flat plates, impossible bodies",
    "as of the separatrix; energy and momentum weigh omega by moments, and are read as the "
    "error of omega that would change them so.",
    lambda only: check_all("shapes"),
)
