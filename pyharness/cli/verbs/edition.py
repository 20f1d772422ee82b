"""The verb `edition`: write the edition as a static web site, or as a package of plain data."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.errors import InputError

FORMATS = ("table", "json")
OPTIONS = {
    "--out DIR": "Write the web pages to this folder, which is created if missing; the first "
    "page is index.html. Give this or --data.",
    "--data DIR": "Write only the data to this folder, as CSV, JSON, TEI and text: cards (lines "
    "of the programs), notes on them, verdicts on the thesis, figures, runs and printed pages.",
    "--docs DIR": "Folder of the documents from which pages are made (default: docs of the "
    "source checkout).",
    "--format F": "Output format of the list of written files: table (default) or json.",
}
EXAMPLE = "edition --out pages"


def run(options: argparse.Namespace) -> int:
    """Write the web site or the data package, and print a list of files."""
    if options.data is not None:
        shared.refuse(options, "--data", ("out", "docs"))
        return _write_package(options)
    from pyharness.cli.output import check_tree, write_tree
    from pyharness.edition.libraries import check_libraries
    from pyharness.edition.report import MARK, edition_report
    from pyharness.views.render import render

    if options.out is None:
        raise InputError(
            "edition: give --out DIR, a folder for the pages, or --data DIR, a folder for the data"
        )
    check_tree(options.out, MARK, "--out")
    check_libraries()
    from pyharness.edition.documents import documents_folder
    from pyharness.edition.site import build_site

    docs = documents_folder(options.docs)
    content = build_site(shared.progress, docs)
    shared.end_progress()
    write_tree(options.out, content, "--out")
    shared.emit(render(edition_report(options.out, content), options.format or "table"), None)
    return 0


def _write_package(options: argparse.Namespace) -> int:
    from pyharness.cli.output import check_tree, write_tree
    from pyharness.edition.crate import PACKAGE_MARK
    from pyharness.edition.data_package import data_package
    from pyharness.edition.report import package_report
    from pyharness.views.render import render

    check_tree(options.data, PACKAGE_MARK, "--data", "data package")
    content = data_package(shared.progress)
    shared.end_progress()
    write_tree(options.data, content, "--data")
    shared.emit(render(package_report(options.data, content), options.format or "table"), None)
    return 0
