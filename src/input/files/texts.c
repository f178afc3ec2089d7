#define _GNU_SOURCE
#include "input/files/texts.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK_BYTES = 64 << 10, FIRST_SLOTS = 64 };

typedef struct CtsTextBlock {
    struct CtsTextBlock *next;
    size_t used, size;
    char bytes[];
} CtsTextBlock;

const char *cts_texts_keep(CtsTexts *t, const char *text, size_t n)
{
    CtsTextBlock *b = t->blocks;
    if (!b || b->size - b->used <= n) {
        const size_t least = t->blocks ? BLOCK_BYTES : BLOCK_BYTES / 16, size = n < least ? least : n + 1;
        if (n > SIZE_MAX / 2 || !(b = malloc(sizeof *b + size)))
            return NULL;
        *b = (CtsTextBlock){.next = t->blocks, .size = size};
        t->blocks = b;
    }
    char *const copy = b->bytes + b->used;
    if (n)
        memcpy(copy, text, n);
    copy[n] = 0;
    b->used += n + 1;
    return copy;
}

static uint64_t hash_of(const char *text, size_t n)
{
    uint64_t h = 14695981039346656037u;
    for (size_t i = 0; i < n; i++)
        h = (h ^ (uint8_t)text[i]) * 1099511628211u;
    return h ^ h >> 32;
}

/* The slot that holds the text, or the empty one where it belongs. */
static const char **slot_of(const char **slots, size_t n_slots, const char *text, size_t n)
{
    for (size_t i = (size_t)hash_of(text, n) & (n_slots - 1);; i = (i + 1) & (n_slots - 1))
        if (!slots[i] || (strncmp(slots[i], text, n) == 0 && !slots[i][n]))
            return &slots[i];
}

static int grow(CtsTexts *t)
{
    const size_t n_slots = t->n_slots ? 2 * t->n_slots : FIRST_SLOTS;
    const char **slots = calloc(n_slots, sizeof *slots);
    if (!slots)
        return 0;
    for (size_t i = 0; i < t->n_slots; i++)
        if (t->shared[i])
            *slot_of(slots, n_slots, t->shared[i], strlen(t->shared[i])) = t->shared[i];
    free(t->shared);
    t->shared = slots;
    t->n_slots = n_slots;
    return 1;
}

const char *cts_texts_share(CtsTexts *t, const char *text, size_t n)
{
    n = strnlen(text, n);
    if (2 * t->n_shared >= t->n_slots && !grow(t))
        return NULL;
    const char **slot = slot_of(t->shared, t->n_slots, text, n);
    if (!*slot && (*slot = cts_texts_keep(t, text, n)))
        t->n_shared++;
    return *slot;
}

void cts_texts_free(CtsTexts *t)
{
    for (CtsTextBlock *b = t->blocks, *next; b; b = next) {
        next = b->next;
        free(b);
    }
    free(t->shared);
    *t = (CtsTexts){0};
}
