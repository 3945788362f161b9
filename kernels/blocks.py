"""Blocks: how items are shared out to threads that go through some each, to sum them or to find an extreme."""

import warp as wp


@wp.struct
class Blocks:
    """Item k of block b is item b apart + k stride, k < size, as long as that is below `count`.

    On a CPU a block is a run of items, which one thread reads from end to end. On a GPU blocks are interleaved, so that
    threads side by side read side by side.
    """

    count: int  # of items
    size: int  # of a block
    apart: int
    stride: int


@wp.func
def item_of(blocks: Blocks, block: int, k: int) -> int:
    """Item k of a block; of the last block there may be none, `blocks.count` or more."""
    return block * blocks.apart + k * blocks.stride
