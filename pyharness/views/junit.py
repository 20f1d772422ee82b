"""The checks of a report as JUnit XML, for continuous integration."""

from xml.etree import ElementTree as xml

from pyharness.model.report import Report


def write(report: Report) -> str:
    """Return a test suite with a case for each check.

    A failed case has the reason, and the command that repeats the check.
    """
    suite = xml.Element(
        "testsuite",
        name=report.title,
        tests=str(len(report.cases)),
        failures=str(sum(bool(why) for _, _, why, _ in report.cases)),
        errors="0",
        skipped="0",
    )
    for kind, id, why, replay in report.cases:
        named = {"classname": f"{report.title}.{kind}", "name": id}
        case = xml.SubElement(suite, "testcase", named)
        if why:
            xml.SubElement(case, "failure", message=why).text = f"{why}\n{replay}"
    xml.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + xml.tostring(suite, "unicode") + "\n"
