"""Trial of extreme shapes: needles, coins, flat plates, and impossible moments."""

from pyharness.checks.hold import check_all
from pyharness.checks.stress import Trial

TRIAL = Trial(
    "shapes",
    "needles with ratios of moments up to 1e12, flat plates, and moments that no body can have",
    "As in the trial separatrix. A change of energy or momentum counts as the smallest error of "
    "omega that causes it.",
    lambda only: check_all("shapes"),
)
