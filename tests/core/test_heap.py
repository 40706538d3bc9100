"""The heaps of the kernels against a sorted list."""

import numpy as np
import pytest

from clamp3d.core import kernel_heap, kernel_zonoid


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


@pytest.mark.parametrize("count", [1, 2, 3, 30])
def test_cells_leave_by_their_bounds(count):
    rng = np.random.default_rng(count)
    heap, waiting, n = np.full((count + 1, 5), np.nan), [], 0
    for _ in range(2000):
        if n < count and (n == 0 or rng.random() < 0.55):
            cell = rng.integers(0, 9, 5).astype(float)
            waiting.append(cell.tolist())
            n = kernel_zonoid.push(heap, n, *cell)
        else:
            first = heap[0].tolist()
            assert first[0] == min(waiting)[0]
            waiting.remove(first)
            n = kernel_zonoid.drop(heap, n)
        assert sorted(heap[:n].tolist()) == sorted(waiting)
        assert np.isnan(heap[count]).all()
