"""The pytest plugin: fixtures for the tests of specs, and an option that keeps the certificates.

Pytest loads this at every start wherever stc is installed, so that nothing is imported before it is used.

``solve_spec``
    Solves a spec once per session for all tests that ask for the same numbers.  Specs are looked for beside the
    test, then where pytest runs, then among the bundled ones.
``certify_motion``
    Validates a motion and gives its certificate, without judging it.
``--stc-report FOLDER``
    Writes the certificate of every motion that ``assert_physical`` judges into a folder.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from stc.solution import Solution
    from stc.validate.certificate import Certificate

__all__ = ["certify_motion", "pytest_addoption", "pytest_configure", "pytest_unconfigure", "solve_spec"]


def pytest_addoption(parser: pytest.Parser) -> None:
    """The plugin's option."""
    parser.getgroup("stc", "motions that stc solves").addoption(
        "--stc-report",
        metavar="FOLDER",
        default=None,
        help="write the certificate of every motion that assert_physical judges into this folder",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Start keeping certificates if asked to.

    Raises:
        pytest.UsageError: nothing can be written to the folder.
    """
    folder = config.getoption("--stc-report", None)
    if folder is not None:
        from pathlib import Path

        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            what = "that is a file" if isinstance(error, FileExistsError) else error.strerror or str(error)
            raise pytest.UsageError(f"--stc-report {folder}: {what}: it takes a folder") from None
        if not os.access(folder, os.W_OK):
            raise pytest.UsageError(f"--stc-report {folder}: nothing can be written to that folder")
        from stc.testing import keep_certificates

        keep_certificates(folder)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Stop keeping certificates."""
    if config.getoption("--stc-report", None) is not None:
        from stc.testing import keep_certificates

        keep_certificates(None)


@pytest.fixture(scope="session")
def _solutions() -> dict[object, Solution]:
    """The solutions of this session."""
    return {}


@pytest.fixture
def solve_spec(request: pytest.FixtureRequest, _solutions: dict[object, Solution]) -> Callable[..., Solution]:
    """A function that solves a spec, or returns an earlier solution of it from this session: ``solve_spec("reach.stc",
    g=1.62)``.

    Its arguments are those of :func:`stc.testing.assert_solves`.
    """

    def solved(spec: str | os.PathLike[str], **options: Any) -> Solution:
        __tracebackhide__ = True
        from stc.testing import assert_solves

        beside = request.path.parent / spec if "\n" not in str(spec) else None
        found = str(beside) if beside is not None and beside.is_file() else spec
        key = (str(found), tuple(sorted(options.items())))
        if key not in _solutions:
            _solutions[key] = assert_solves(found, **options)
        return _solutions[key]

    return solved


@pytest.fixture
def certify_motion() -> Callable[..., Certificate]:
    """:func:`stc.certification.certify`: validates a motion without judging it."""
    from stc.certification import certify

    return certify
