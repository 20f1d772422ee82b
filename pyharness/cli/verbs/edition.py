"""The verb `edition`: write the edition of the three programs as a static web site."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.errors import InputError

FORMATS = ("table", "json")
OPTIONS = {
    "--out DIR": "Write the web pages to this folder, which is created if missing; the first "
    "page is index.html.",
    "--docs DIR": "Folder of the documents from which the pages are made (default: the folder docs "
    "of the source checkout).",
    "--format F": "Output format of the list of written files: table (default) or json.",
}
EXAMPLE = "edition --out pages"


def run(options: argparse.Namespace) -> int:
    """Make all pages of the project's web site, write them to a folder, and print a list of files.

    Return exit status 0.
    """
    from pyharness.cli.output import check_tree, write_tree
    from pyharness.edition.libraries import check_libraries
    from pyharness.edition.report import MARK, edition_report
    from pyharness.views.render import render

    if options.out is None:
        raise InputError("edition: give --out DIR, a folder for the pages")
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
