#include "export/runs_deflate.h"

#include <endian.h>
#include <stdlib.h>
#include <string.h>

/* Input of one block: its codes fit what it holds, and cost a hundred bytes. */
enum { BLOCK = 64 << 10 };
enum { LITERALS = 286, END_OF_BLOCK = 256, LENGTH_CODES = 19, MOST_BITS = 15, MOST_LENGTH_BITS = 7 };
enum { SHORTEST = 4, LONGEST = 258 }; /* runs, less their first byte */

/* Of the symbols of one alphabet. */
typedef struct Codes {
    uint32_t count[LITERALS];
    uint8_t bits[LITERALS];
    uint16_t code[LITERALS]; /* first bit lowest */
} Codes;

typedef struct Symbol {
    uint32_t count;
    uint16_t symbol;
} Symbol;

static int by_count(const void *a, const void *b)
{
    const Symbol *x = a, *y = b;
    return x->count != y->count ? (x->count > y->count) - (x->count < y->count) : x->symbol - y->symbol;
}

/* How long Huffman's codes of n symbols, in rising order of their counts, are: the two lightest nodes join until one is
 * left. Leaves and joined nodes come in rising order each, so the lightest stand at the front of two queues. */
static void find_depths(const Symbol *list, int n, int depth[])
{
    uint32_t weight[2 * LITERALS];
    int parent[2 * LITERALS], leaf = 0, inner = n;
    for (int i = 0; i < n; i++)
        weight[i] = list[i].count;
    for (int node = n; node < 2 * n - 1; node++) {
        weight[node] = 0;
        for (int child = 0; child < 2; child++) {
            const int lightest = leaf < n && (inner == node || weight[leaf] <= weight[inner]) ? leaf++ : inner++;
            weight[node] += weight[lightest];
            parent[lightest] = node;
        }
    }
    depth[2 * n - 2] = 0;
    for (int i = 2 * n - 3; i >= 0; i--)
        depth[i] = depth[parent[i]] + 1;
}

/* n_of[l] codes have l bits, none more than most: longer ones are cut, and shorter ones made longer until all have
 * room. */
static void limit_bits(int n_of[], int deepest, int most)
{
    uint32_t taken = 0; /* of 2^most */
    for (int l = most + 1; l <= deepest; l++)
        n_of[most] += n_of[l];
    for (int l = 1; l <= most; l++)
        taken += (uint32_t)n_of[l] << (most - l);
    for (; taken > UINT32_C(1) << most; taken--) {
        int l = most - 1;
        while (!n_of[l])
            l--;
        n_of[most]--;
        n_of[l]--;
        n_of[l + 1] += 2;
    }
}

static uint16_t reversed(uint32_t code, int bits)
{
    uint32_t r = 0;
    for (int i = 0; i < bits; i++)
        r |= (code >> i & 1) << (bits - 1 - i);
    return (uint16_t)r;
}

/* Lengths and codes of the symbols that occur; at least one does. */
static void make_codes(Codes *c, int n_symbols, int most)
{
    Symbol list[LITERALS];
    int depth[2 * LITERALS], n_of[LITERALS + 1] = {0}, n = 0, deepest = most;
    uint32_t next[MOST_BITS + 2] = {0};
    memset(c->bits, 0, (size_t)n_symbols);
    for (int s = 0; s < n_symbols; s++)
        if (c->count[s])
            list[n++] = (Symbol){c->count[s], (uint16_t)s};
    qsort(list, (size_t)n, sizeof *list, by_count);
    find_depths(list, n, depth);
    for (int i = 0; i < n; i++) {
        const int bits = depth[i] ? depth[i] : 1; /* a single symbol */
        deepest = bits > deepest ? bits : deepest;
        n_of[bits]++;
    }
    limit_bits(n_of, deepest, most);
    for (int l = most, i = 0; l >= 1; l--)
        for (int k = 0; k < n_of[l]; k++)
            c->bits[list[i++].symbol] = (uint8_t)l;
    for (int l = 1; l <= most; l++)
        next[l + 1] = (next[l] + (uint32_t)n_of[l]) << 1;
    for (int s = 0; s < n_symbols; s++)
        if (c->bits[s])
            c->code[s] = reversed(next[c->bits[s]]++, c->bits[s]);
}

/* Where the bits go. Eight bytes are written at a time, of which those behind the end are written over. */
typedef struct Out {
    uint8_t *at;
    uint64_t bits;
    int n;
} Out;

/* At most 56 bits between two flushes. */
static inline void put(Out *o, uint64_t bits, int n)
{
    o->bits |= bits << o->n;
    o->n += n;
}

static inline void flush(Out *o)
{
    const uint64_t bits = htole64(o->bits);
    memcpy(o->at, &bits, sizeof bits);
    o->at += o->n >> 3;
    o->bits >>= o->n & ~7;
    o->n &= 7;
}

/* How many bytes from `at` on repeat the one before it; 0 where those are not worth a run. */
static inline size_t run_at(const uint8_t *start, const uint8_t *at, const uint8_t *end)
{
    uint32_t own, before;
    if (at == start || end - at < SHORTEST)
        return 0;
    memcpy(&own, at, sizeof own);
    memcpy(&before, at - 1, sizeof before);
    if (own != before)
        return 0;
    const uint8_t *p = at + SHORTEST;
    for (uint64_t a, b; end - p >= 8; p += 8) {
        memcpy(&a, p, sizeof a);
        memcpy(&b, p - 1, sizeof b);
        if (a != b)
            break;
    }
    while (p < end && *p == p[-1])
        p++;
    return (size_t)(p - at);
}

/* Of a run, the next piece that one code can tell; what is left of less than SHORTEST bytes are literals. */
static inline size_t piece_of(size_t run)
{
    return run < LONGEST ? run : LONGEST;
}

/* The length code of 3 to 258 bytes: its symbol, and its extra bits. */
static inline int length_symbol(size_t length, int *n_extra, uint32_t *extra)
{
    if (length == LONGEST) {
        *n_extra = 0;
        *extra = 0;
        return 285;
    }
    const uint32_t x = (uint32_t)length - 3;
    const int e = x < 8 ? 0 : 29 - __builtin_clz(x);
    *n_extra = e;
    *extra = x & ((1u << e) - 1);
    return 257 + 4 * e + (int)(x >> e);
}

static void count_block(const uint8_t *start, const uint8_t *at, const uint8_t *end, Codes *c)
{
    uint32_t odd[256] = {0}; /* neighbours apart: the same byte twice need not wait for itself */
    memset(c->count, 0, sizeof c->count);
    c->count[END_OF_BLOCK] = 1;
    while (at < end) {
        size_t run = run_at(start, at, end);
        if (!run) {
            ((at - start) & 1 ? odd : c->count)[*at]++;
            at++;
        }
        for (size_t piece; run >= SHORTEST; run -= piece, at += piece) {
            int n_extra;
            uint32_t extra;
            piece = piece_of(run);
            c->count[length_symbol(piece, &n_extra, &extra)]++;
        }
    }
    for (int s = 0; s < 256; s++)
        c->count[s] += odd[s];
}

static void write_block(const uint8_t *start, const uint8_t *at, const uint8_t *end, const Codes *c, Out *o)
{
    while (at < end) {
        size_t run = run_at(start, at, end);
        if (!run) {
            put(o, c->code[*at], c->bits[*at]);
            at++;
            if (o->n >= 32)
                flush(o);
        }
        for (size_t piece; run >= SHORTEST; run -= piece, at += piece) {
            int n_extra;
            uint32_t extra;
            piece = piece_of(run);
            const int symbol = length_symbol(piece, &n_extra, &extra);
            flush(o);
            put(o, c->code[symbol], c->bits[symbol]);
            put(o, extra, n_extra);
            put(o, 0, 1); /* the only distance: one byte back */
        }
    }
    flush(o);
    put(o, c->code[END_OF_BLOCK], c->bits[END_OF_BLOCK]);
    flush(o);
}

/* The lengths of all codes, as RFC 1951 has them: symbols 0 to 15 are lengths, 16 repeats the one before 3 to 6 times,
 * 17 and 18 are 3 to 10 and 11 to 138 zeros. */
typedef struct Lengths {
    uint8_t symbol[LITERALS + 1], extra[LITERALS + 1];
    int n, n_literals;
    Codes codes;
} Lengths;

static void add_length(Lengths *l, int symbol, int extra)
{
    l->symbol[l->n] = (uint8_t)symbol;
    l->extra[l->n++] = (uint8_t)extra;
    l->codes.count[symbol]++;
}

static void list_lengths(const Codes *c, Lengths *l)
{
    uint8_t all[LITERALS + 1];
    *l = (Lengths){.n_literals = LITERALS};
    while (l->n_literals > END_OF_BLOCK + 1 && !c->bits[l->n_literals - 1])
        l->n_literals--;
    const int n = l->n_literals + 1;
    memcpy(all, c->bits, (size_t)l->n_literals);
    all[n - 1] = 1; /* the distance */
    for (int i = 0; i < n;) {
        int same = 1;
        while (i + same < n && all[i + same] == all[i])
            same++;
        const int most = all[i] ? 6 : 138, before = all[i] && i > 0 && all[i] == all[i - 1];
        if (same >= 3 && (!all[i] || before)) {
            same = same < most ? same : most;
            if (all[i])
                add_length(l, 16, same - 3);
            else
                add_length(l, same < 11 ? 17 : 18, same < 11 ? same - 3 : same - 11);
        } else {
            same = 1;
            add_length(l, all[i], 0);
        }
        i += same;
    }
    make_codes(&l->codes, LENGTH_CODES, MOST_LENGTH_BITS);
}

static void write_lengths(const Codes *c, Out *o)
{
    static const uint8_t order[LENGTH_CODES] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};
    static const uint8_t extra_bits[LENGTH_CODES] = {[16] = 2, [17] = 3, [18] = 7};
    Lengths l;
    list_lengths(c, &l);
    int n_codes = LENGTH_CODES;
    while (n_codes > 4 && !l.codes.bits[order[n_codes - 1]])
        n_codes--;
    put(o, (uint64_t)(l.n_literals - 257), 5);
    put(o, 0, 5); /* one distance */
    put(o, (uint64_t)(n_codes - 4), 4);
    for (int i = 0; i < n_codes; i++) {
        flush(o);
        put(o, l.codes.bits[order[i]], 3);
    }
    for (int i = 0; i < l.n; i++) {
        flush(o);
        put(o, l.codes.code[l.symbol[i]], l.codes.bits[l.symbol[i]]);
        put(o, l.extra[i], extra_bits[l.symbol[i]]);
    }
    flush(o);
}

/* No code is much longer than 9 bits a byte, which would do for all that there are. */
size_t cts_runs_deflate_bound(size_t n)
{
    return n + n / 4 + (n / BLOCK + 1) * 512 + 64;
}

size_t cts_runs_deflate(const uint8_t *in, size_t n, bool last, uint8_t *out)
{
    Out o = {.at = out};
    Codes codes;
    for (size_t at = 0; at < n; at += BLOCK) {
        const size_t end = n - at < BLOCK ? n : at + BLOCK;
        count_block(in, in + at, in + end, &codes);
        make_codes(&codes, LITERALS, MOST_BITS);
        put(&o, last && end == n, 1);
        put(&o, 2, 2); /* codes of its own */
        write_lengths(&codes, &o);
        write_block(in, in + at, in + end, &codes, &o);
    }
    if (!last)
        put(&o, 0, 3); /* an empty block, stored */
    put(&o, 0, -o.n & 7);
    flush(&o);
    if (!last) {
        put(&o, UINT64_C(0xFFFF0000), 32);
        flush(&o);
    }
    return (size_t)(o.at - out);
}
