import pytest

from wayproof.maps.kernels import work_queue


@pytest.mark.parametrize("take_item", [work_queue.take_item, work_queue.take_item.py_func])
def test_items_are_taken_one_by_one(take_item):
    queue = work_queue.new_queue()
    assert [take_item(queue) for _ in range(4)] == [0, 1, 2, 3]


@pytest.mark.parametrize("take_chunk", [work_queue.take_chunk, work_queue.take_chunk.py_func])
@pytest.mark.parametrize("threads", [1, 2, 7])
@pytest.mark.parametrize("count", [0, 1, 5, 400])
def test_chunks_follow_each_other_and_become_smaller(take_chunk, threads, count):
    queue, end, sizes = work_queue.new_queue(), 0, []
    while (chunk := take_chunk(queue, count, threads))[0] < chunk[1]:
        assert chunk[0] == end
        end = chunk[1]
        sizes.append(chunk[1] - chunk[0])
    assert end == count
    assert sizes == sorted(sizes, reverse=True)
    if count == 400:
        assert sizes[0] == 400 // (work_queue.CHUNK_SHARES * threads)
        assert sizes[-1] == 1
    assert take_chunk(queue, count, threads) == (count, count)
