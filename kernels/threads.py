"""Threads of a CPU meet inside a launch, where no interpreter wakes them."""

import warp as wp

# One counter in each cache line: who counts up must not take the line away from the others.
CACHE_LINE = wp.constant(16)


# A thread that waits looks some 2000 times, a few dozen microseconds: longer than threads that share a launch well are
# apart. After that it gives way to other threads that want its core (not on Windows, where it just goes on looking).
@wp.func_native(
    """
#if !defined(__CUDA_ARCH__)
#if defined(__APPLE__)
    extern int give_way(void) __asm__("_sched_yield");
#elif !defined(_WIN32)
    extern int give_way(void) __asm__("sched_yield");
#endif
    const unsigned met = __atomic_add_fetch(&meetings.data[apart * thread], 1, __ATOMIC_RELEASE);
    for (int other = 0; other < count; ++other) {
        int looked = 0;
        while ((int)((unsigned)__atomic_load_n(&meetings.data[apart * other], __ATOMIC_ACQUIRE) - met) < 0) {
#if !defined(_WIN32)
            if (++looked > 2000) give_way();
#endif
#if defined(__x86_64__)
            __builtin_ia32_pause();
#endif
        }
    }
#endif
"""
)
def wait_for_all(thread: int, count: int, apart: int, meetings: wp.array[int]):
    """Count a meeting of `thread`, and wait until all `count` threads have come to it; counters are `apart`.

    What each of them wrote before is seen by all of them after.
    """
    ...


@wp.kernel(enable_backward=False)
def meet(first: int, count: int, meetings_inout: wp.array[int]):
    """Wait for all of `count` threads; `meetings_inout` counts how often each came, CACHE_LINE apart."""
    i = first + wp.tid()
    wait_for_all(i, count, CACHE_LINE, meetings_inout)
