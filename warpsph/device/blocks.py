"""Blocks on the host's side: into how many a number of items is shared out, and in how many stages."""

import warp as wp

from warpsph.kernels.blocks import Blocks

# Items that one thread goes through: fixed numbers, so that sums do not depend on the number of threads. A GPU has
# many threads and waits long for each load, so its blocks are short, but no more than so many: the host reads sums of
# blocks.
CPU_SIZE, CUDA_SIZE, MOST_CUDA_BLOCKS = 256, 32, 1 << 15


def is_interleaved(device: wp.Device) -> bool:
    """Whether blocks are interleaved, and shared out again until one thread can go through the rest."""
    return device.is_cuda


def blocks_of(count: int, device: wp.Device) -> tuple[Blocks, int]:
    """The blocks that `count` items are shared out to, and their number."""
    blocks = Blocks()
    blocks.count = count
    if is_interleaved(device):
        number = max(1, min(-(-count // CUDA_SIZE), MOST_CUDA_BLOCKS))
        blocks.size, blocks.apart, blocks.stride = -(-count // number), 1, number
    else:
        number = -(-count // CPU_SIZE)
        blocks.size, blocks.apart, blocks.stride = CPU_SIZE, CPU_SIZE, 1
    return blocks, number


def stages_of(count: int, device: wp.Device) -> list[tuple[Blocks, int]]:
    """Blocks of `count` items, blocks of these and so on, until one thread can go through those that are left."""
    stages = []
    while is_interleaved(device) and count > CUDA_SIZE:
        stages.append(blocks_of(count, device))
        count = stages[-1][1]
    return stages
