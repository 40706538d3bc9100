"""Tables of what is refused."""

from functools import partial

import pytest

from clamp3d import InputError


def refusals(*cases):
    """A test for each case, a call and a regular expression: it raises an InputError of one line in which that is."""

    @pytest.mark.parametrize(("call", "words"), cases)
    def test(call, words):
        with pytest.raises(InputError, match=words) as refused:
            call()
        assert "\n" not in str(refused.value)

    return test


def refusals_of(call, *cases):
    """The same of one call with each case's value."""
    return refusals(*((partial(call, value), words) for value, words in cases))
