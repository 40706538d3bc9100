"""Tables of what is refused."""

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
