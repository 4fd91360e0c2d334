"""Memory that is used again."""

from hypothesis import given
from hypothesis import strategies as st

from aerobat.arrays import Array, Scratch


@given(st.lists(st.tuples(st.integers(1, 5), st.booleans(), st.booleans()), max_size=20))
def test_arrays_of_a_scratch_that_are_in_use_share_no_memory(orders: list[tuple[int, bool, bool]]) -> None:
    """Kept whole, by a part of theirs, or not at all."""
    scratch, kept = Scratch(), list[Array]()
    for number, (rows, is_kept, whole) in enumerate(orders):
        array = scratch.empty((rows, 3))
        array[:] = number
        if is_kept:
            kept.append(array if whole else array[0])
        del array
    numbers = [number for number, (_, is_kept, _) in enumerate(orders) if is_kept]
    assert [each.ravel()[-1] for each in kept] == numbers


def test_memory_that_is_no_longer_in_use_is_used_again() -> None:
    scratch = Scratch()
    array = scratch.empty((4, 5))
    place = array.ctypes.data
    other = scratch.empty((4, 5))
    assert other.ctypes.data != place
    del array
    assert scratch.empty((2, 3)).ctypes.data == place
