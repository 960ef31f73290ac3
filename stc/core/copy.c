/* Copies of blocks of memory where the C library's do badly.
 *
 * Large ones go past the caches, which they would only empty.  What is overwritten as a whole need not be read before,
 * which is a third of the traffic.  The library knows that as well, but from sizes on that depend on caches as a
 * virtual machine describes them: hundreds of megabytes.
 *
 * For smaller ones it has an instruction (rep movsb) that some processors take ten times as long for where the target is
 * a few bytes behind the source within a page, as neighbouring parts of one array are (glibc before 2.39 on Zen 3 and 4:
 * its bug 30994).
 */
#include <string.h>

#include "calls.h"

#if defined(CORE_X86)
#include <emmintrin.h>

enum {
    LARGE = 1 << 22,   /* bytes: a processor cannot count on finding as much again */
    MIDDLING = 1 << 11, /* blocks smaller than this may be left to that instruction */
    PAGE = 4096,
    BEHIND = 63, /* it is slow where the target is so much further in its page than the source, or less */
    LINE = 64,
};

static void copy_lines(char *to, const char *from, size_t size, int past_caches) {
    size_t head = -(uintptr_t)to & (LINE - 1), whole = (size - head) & ~(size_t)(LINE - 1);
    memmove(to, from, head);
    for (size_t at = head; at < head + whole; at += LINE)
        for (int k = 0; k < LINE; k += 16) {
            __m128i part = _mm_loadu_si128((const __m128i *)(from + at + k));
            if (past_caches) _mm_stream_si128((__m128i *)(to + at + k), part);
            else _mm_store_si128((__m128i *)(to + at + k), part);
        }
    if (past_caches) _mm_sfence(); /* other threads may read what has been copied */
    memmove(to + head + whole, from + head + whole, size - head - whole);
}

void *copy_block(void *to, const void *from, size_t size) {
    size_t ahead = (uintptr_t)to - (uintptr_t)from, behind = (uintptr_t)from - (uintptr_t)to;
    if (size >= MIDDLING && ahead >= size && behind >= size) {
        int slow = ((ahead & (PAGE - 1)) - 1) < BEHIND;
        if (size >= LARGE || slow) {
            copy_lines(to, from, size, size >= LARGE);
            return to;
        }
    }
    return memmove(to, from, size);
}
#else
void *copy_block(void *to, const void *from, size_t size) { return memmove(to, from, size); }
#endif
