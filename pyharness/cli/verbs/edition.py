"""The verb `edition`."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.errors import InputError

FORMATS = ("table", "json")
OPTIONS = {
    "--out DIR": "Write the web pages to this folder (created if missing); the first is "
    "index.html.",
    "--data DIR": "Write the data to this folder, as CSV, JSON, TEI (XML) "
    "and text: cards (program lines), notes, verdicts on the thesis, figures, runs, printed "
    "pages.",
    "--docs DIR": "With --out, folder of the documents that also become pages (default: the folder "
    "docs of the source checkout or, without one, of the current folder).",
    "--format F": "Output format of the list of written files: table (default) or json.",
}
USAGE = "(--out DIR | --data DIR)"
EXAMPLE = "edition --out pages"


def run(options: argparse.Namespace) -> int:
    from pyharness.cli.output import check_tree, write_tree
    from pyharness.edition.report import MARK, check_libraries, edition_report, package_report

    if options.data is not None:
        from pyharness.edition.citation import PACKAGE_MARK
        from pyharness.edition.data_package import data_package

        shared.refuse(options, "--data", ("out", "docs"))
        folder, option = options.data, "--data"
        check_tree(folder, PACKAGE_MARK, option, "data package")
        content = data_package(shared.progress)
        report = package_report(folder, content)
    elif options.out is not None:
        folder, option = options.out, "--out"
        check_tree(folder, MARK, option)
        check_libraries()
        from pyharness.edition.documents import documents_folder
        from pyharness.edition.site import build_site

        content = build_site(shared.progress, documents_folder(options.docs))
        report = edition_report(folder, content)
    else:
        raise InputError(
            "edition: give --out DIR, a folder for the pages, or --data DIR, a folder for the data"
        )
    shared.end_progress()
    write_tree(folder, content, option)
    return shared.show(report, shared.without_out(options))
