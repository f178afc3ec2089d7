#include "base/string_pool.h"

#include "base/bytes.h"
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK_BYTES = 64 << 10 };

typedef struct CtsStringPoolBlock {
    struct CtsStringPoolBlock *next;
    size_t used, size;
    char bytes[];
} CtsStringPoolBlock;

const char *cts_string_pool_add(CtsStringPool *t, const char *text, size_t n)
{
    CtsStringPoolBlock *b = t->blocks;
    if (!b || b->size - b->used <= n) {
        const size_t least = t->blocks ? BLOCK_BYTES : BLOCK_BYTES / 16, size = n < least ? least : n + 1;
        if ((t->no_memory = n > SIZE_MAX / 2 || !(b = malloc(sizeof *b + size))))
            return NULL;
        *b = (CtsStringPoolBlock){.next = t->blocks, .size = size};
        t->blocks = b;
    }
    char *const copy = b->bytes + b->used;
    if (n)
        memcpy(copy, text, n);
    copy[n] = 0;
    b->used += n + 1;
    return copy;
}

const char *cts_string_pool_share(CtsStringPool *t, const char *text, size_t n)
{
    n = strnlen(text, n);
    const uint64_t hash = cts_fnv(CTS_FNV, text, n);
    const char **slot = &t->shared[(hash ^ hash >> 32) % CTS_TEXT_SLOTS];
    if (!*slot || strncmp(*slot, text, n) != 0 || (*slot)[n])
        *slot = cts_string_pool_add(t, text, n);
    return *slot;
}

void cts_string_pool_join(CtsStringPool *to, CtsStringPool *from)
{
    CtsStringPoolBlock **end = &to->blocks;
    while (*end)
        end = &(*end)->next;
    *end = from->blocks;
    *from = (CtsStringPool){0};
}

void cts_string_pool_free(CtsStringPool *t)
{
    for (CtsStringPoolBlock *b = t->blocks, *next; b; b = next) {
        next = b->next;
        free(b);
    }
    *t = (CtsStringPool){0};
}
