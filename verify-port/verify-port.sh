#!/bin/sh
# Compare a port with the programs of rigid-body-harness. The Action in this folder runs this script,
# and so can any other service, or a person. Variables of the environment:
#   PORT_COMMAND  the command that starts the port
#   PORT_CELLS    the cells in which it is checked, separated by commas (default: all)
#   PORT_DRAWS    the number of random scenes in which it is checked too (default: 0)
#   PORT_SEED     the text that seeds the random scenes (default: the year and week)
#   PORT_REPORTS  the folder for summary.md, junit.xml and report.json (default: port-reports)
#   PYTHON        the Python in which rigid-body-harness is installed (default: python3)
# The summary is also added to the file GITHUB_STEP_SUMMARY, if this variable is set. The exit status
# is that of `pyharness verify`: 0 if no bit differs, 1 if one does, 2 for a mistake in a variable.
set -eu
reports=${PORT_REPORTS:-port-reports}
mkdir -p "$reports"
# A report of an earlier run must not be taken for that of this one.
rm -f "$reports/summary.md" "$reports/junit.xml" "$reports/report.json"

# With = a value that begins with a dash is no option.
set -- "--port=${PORT_COMMAND:-}"
[ -z "${PORT_CELLS:-}" ] || set -- "$@" "--cell=$PORT_CELLS"
[ -z "${PORT_DRAWS:-}" ] || set -- "$@" "--draws=$PORT_DRAWS"
[ -z "${PORT_SEED:-}" ] || set -- "$@" "--seed=$PORT_SEED"
status=0
"${PYTHON:-python3}" -m pyharness verify "$@" \
  --also "$reports/summary.md,$reports/junit.xml,$reports/report.json" || status=$?
if [ -n "${GITHUB_STEP_SUMMARY:-}" ] && [ -f "$reports/summary.md" ]; then
  cat "$reports/summary.md" >>"$GITHUB_STEP_SUMMARY"
fi
exit "$status"
