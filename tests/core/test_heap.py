"""The heap of the kernels against a sorted list."""

import numpy as np
import pytest

from clamp3d.core import kernel_heap


@pytest.mark.parametrize("count", [1, 2, 3, 30])
def test_rows_leave_in_order_of_their_first_numbers_that_differ(count):
    rng = np.random.default_rng(count)
    heap, waiting, n = np.full((count + 1, 3), np.nan), [], 0
    for _ in range(2000):
        if n < count and (n == 0 or rng.random() < 0.55):
            heap[n] = rng.integers(0, 4, 3)
            waiting.append(heap[n].tolist())
            n = kernel_heap.push(heap, n)
        else:
            n = kernel_heap.pop(heap, n)
            assert heap[n].tolist() == min(waiting)
            waiting.remove(min(waiting))
        assert n == len(waiting)
        assert np.isnan(heap[count]).all()


def test_a_row_of_five_is_put_where_it_belongs():
    heap = np.full((4, 5), np.nan)
    for n, low in enumerate((3.0, 1.0, 2.0)):
        assert kernel_heap.put(heap, n, low, 5.0, 6.0, 7.0, 8.0) == n + 1
    assert heap[:3, 0].tolist() == [1.0, 3.0, 2.0]
    assert (heap[:3, 1:] == [5.0, 6.0, 7.0, 8.0]).all()
    assert np.isnan(heap[3]).all()
