"""Error tree: what a user may cause is a QuadlabError, and parameters are one branch."""

from __future__ import annotations

import pytest

from quadrotor import errors

ALL = [e for e in vars(errors).values() if isinstance(e, type) and issubclass(e, Exception)]


@pytest.mark.parametrize("error", ALL)
def test_every_error_is_a_quadlab_error_with_a_docstring(error: type[Exception]) -> None:
    assert issubclass(error, errors.QuadlabError)
    assert error.__doc__


def test_parameter_errors_are_caught_together() -> None:
    for error in (
        errors.UnknownParameterError,
        errors.OutOfBoundsError,
        errors.WrongTypeError,
        errors.ReadOnlyError,
    ):
        assert issubclass(error, errors.ParameterError)
    assert not issubclass(errors.RefusedError, errors.ParameterError)
