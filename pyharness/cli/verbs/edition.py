"""`edition`: the edition as pages."""

import argparse

from pyharness.cli import options as shared
from pyharness.model.errors import InputError

FORMATS = ("table", "json")
OPTIONS = {
    "--out DIR": "folder for the pages, index.html at its top; made if missing",
    "--docs DIR": "the documents, docs of the source (default: those of the checkout)",
    "--format F": "table (default) or json: of what was written",
}


def run(options: argparse.Namespace) -> int:
    """Make all pages, then write them."""
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
    content = build_site(lambda what: shared.progress(f"edition: {what}"), docs)
    shared.progress("")
    write_tree(options.out, content, "--out")
    shared.emit(render(edition_report(options.out, content), options.format or "table"), None)
    return 0
