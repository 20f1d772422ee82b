"""`--order SEED`: the tests in a random order, so that none needs what another leaves."""

from random import Random

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--order", metavar="SEED", help="run the tests in a random order")


def pytest_report_header(config: pytest.Config) -> str:
    seed = config.getoption("--order")
    return f"random order: --order {seed}" if seed else ""


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Shuffle the tests; those of one file too are apart."""
    if seed := config.getoption("--order"):
        Random(str(seed)).shuffle(items)
